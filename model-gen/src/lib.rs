//! Turns a trained artifact into Rust integers: filter design, quantisation, range proofs, code.
#![forbid(unsafe_code)]
