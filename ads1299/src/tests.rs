//! The driver against the simulated chain, and the decoder against an encoder.

mod decoding;
mod faults;
mod self_test;
mod start_up;
mod streams;
