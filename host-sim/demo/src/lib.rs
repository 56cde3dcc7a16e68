//! Frequency response of the filters, as the demo and the benchmark of the filters draw it.
#![forbid(unsafe_code)]

pub mod response;
