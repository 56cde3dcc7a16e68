//! The generated filters, resampler, weights and network.

use fixed_dsp::{Cascade, Coefficient, Design, Resampler, Section};
use int8_nn::Pair;

use crate::{
    constants::{CODE, CodeFormat, ELECTRODES, HOP, MainsFilter, PHASES, SECTIONS, TAPS},
    network::{ConvWeights, Network},
    packed::Packed,
    substitution::Substitution,
};

include!(concat!(env!("OUT_DIR"), "/statics.rs"));
