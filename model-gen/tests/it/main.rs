//! Integration tests: filters and resamplers compared with scipy's, code formats, and models for
//! other amplifiers.
#![forbid(unsafe_code)]

mod chain;
mod code_formats;
mod rates;
mod resampler;
mod scipy_response;
