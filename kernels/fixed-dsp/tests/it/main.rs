//! Compares the filters with floating-point references and with exact integer references.
#![forbid(unsafe_code)]

mod float_twin;
mod same_bits;
