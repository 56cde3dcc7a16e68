//! Integration tests: scenarios of the application on emulated microcontrollers, one module each.
#![forbid(unsafe_code)]

mod all_streams;
mod damaged_model;
mod golden_vectors;
mod restart;
mod stalled_host;
mod storm;
mod undisturbed;
