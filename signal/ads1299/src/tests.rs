//! The driver against the simulated chain, and the decoder against an encoder.

mod decoding;
mod faults;
mod retrying;
mod sampling;
mod self_test;
mod start_up;
mod streams;
mod whole_self_test;
