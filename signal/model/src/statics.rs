//! The generated filters, resampler, weights and network.

use fixed_dsp::{Cascade, Coefficient, Design, Resampler, Section};
use int8_nn::Pair;

use crate::{
    code_format::CodeFormat,
    constants::{CODE, ELECTRODES, HOP, PHASES, SECTIONS, TAPS},
    mains_filter::MainsFilter,
    network::{ConvWeights, Network},
    packed::Packed,
};

include!(concat!(env!("OUT_DIR"), "/statics.rs"));
