//! The driver against the simulated chain, and the decoder against an encoder.

mod decoding;
