//! The generated filters, resampler, weights and network.

use ::packed::Tables;
use fixed_dsp::{Cascade, Coefficient, Design, Resampler, Section};
use int8_nn::{Linear, Pair};

use crate::{
    code_format::CodeFormat,
    constants::{CODE, ELECTRODES, HOP, PACKED_COEFFICIENTS, PHASES, SECTIONS, TAPS},
    mains_filter::MainsFilter,
    network::{ConvWeights, Network},
    packed::{Packed, Slice},
};

include!(concat!(env!("OUT_DIR"), "/statics.rs"));
