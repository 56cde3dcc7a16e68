//! Filters compared with float and with exact references.
#![forbid(unsafe_code)]

mod float_twin;
mod same_bits;
