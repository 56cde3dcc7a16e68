//! Expected outputs of the vectors, written by `build.rs`.
#![allow(
    clippy::unreadable_literal,
    reason = "generated numbers in the format of the model"
)]

use fixed_dsp::{Cascade, Coefficient, Resampler, Section};
use model::{CELLS, CODE, STEPS};
use pipeline::{Code, CodeValues};

use crate::filters::Filtered;

include!(concat!(env!("OUT_DIR"), "/golden.rs"));
