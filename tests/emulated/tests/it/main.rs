//! Integration tests: one module for each scenario of the application on emulated microcontrollers.
#![forbid(unsafe_code)]

mod all_streams;
mod damaged_model;
mod golden_vectors;
mod restart;
mod stalled_host;
mod storm;
mod undisturbed;
