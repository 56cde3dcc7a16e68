//! Integration tests: filters against scipy, code formats, tables of substitutions, and models
//! for other amplifiers.
#![forbid(unsafe_code)]

mod chain;
mod code_formats;
mod rates;
mod resampler;
mod scipy_response;
mod substitution;
