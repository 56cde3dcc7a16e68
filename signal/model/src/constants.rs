//! The generated constants: rates, scales, dimensions, and the kernel of the second convolution.

use int8_nn::{Pair, PlaneShape};

include!(concat!(env!("OUT_DIR"), "/constants.rs"));
