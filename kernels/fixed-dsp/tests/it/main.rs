//! Compares the filters with float references and with exact ones.
#![forbid(unsafe_code)]

mod float_twin;
mod same_bits;
