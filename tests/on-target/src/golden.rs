//! What the vectors expect; `build.rs` has written it.
#![allow(
    clippy::unreadable_literal,
    reason = "numbers to compare with, in whatever format the model has"
)]

use fixed_dsp::{Cascade, Coefficient, Resampler, Section};
use model::{CELLS, CODE, STEPS};
use pipeline::{Code, CodeValues};

use crate::filters::Filtered;

include!(concat!(env!("OUT_DIR"), "/golden.rs"));
