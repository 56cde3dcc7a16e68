//! EEG from sample to code: filters, decimation, scalp grid, quantisation, encoder.
#![no_std]
#![forbid(unsafe_code)]
