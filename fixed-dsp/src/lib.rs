//! Fixed-point filter sections, cascades and decimators: signals, nothing about EEG.
#![no_std]
#![forbid(unsafe_code)]
