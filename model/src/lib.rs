//! What training decided, as constants: filters, montage, scales and the int8 encoder.
#![no_std]
#![forbid(unsafe_code)]
