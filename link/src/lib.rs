//! The wire format between board and host, both ends.
#![no_std]
#![forbid(unsafe_code)]
