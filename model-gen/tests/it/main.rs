//! Integration tests: filters and resamplers against scipy, code formats, and other amplifiers.
#![forbid(unsafe_code)]

mod chain;
mod code_formats;
mod rates;
mod resampler;
mod scipy_response;
