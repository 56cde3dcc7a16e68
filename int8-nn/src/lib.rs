//! Int8 neural-network kernels, batch and streaming: nothing about our network.
#![no_std]
#![forbid(unsafe_code)]
