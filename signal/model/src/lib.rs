//! The trained model as constants: filters, montage, scales, the int8 encoder and the packed code.
//! A model has the network, the packed code or both ([`HAS_NETWORK`], [`PACKED`]), and can have the
//! table from which a device substitutes bad electrodes ([`SUBSTITUTION`]).
//!
//! model-gen generates the constants and weights at build time from the artifact in `artifact/`, or
//! in the folder that the environment variable `CORTICODE_ARTIFACT` names, and proves their ranges.
//! `manifest.txt` summarises the model in `artifact/` for human readers.
//!
//! ```text
//! artifact/ --build.rs, model-gen--> constants.rs --> shapes: PlaneShape, lengths of weights
//!                                          |              |
//!                                          v              v
//!                                    MainsFilter       Network
//!                                          |              |
//!                                    statics.rs: MAINS_50, MAINS_60, RESAMPLER, NETWORK
//! ```
//!
//! ```
//! use model::{ADC_RATE_HZ, CODE, CODE_FORMAT, NETWORK, NETWORK_CHECKSUM, STEP_RATE_HZ};
//!
//! assert!(ADC_RATE_HZ >= STEP_RATE_HZ);
//! assert!(CODE_FORMAT.bytes() >= CODE);
//! // The check that a board makes at start.
//! assert_eq!(NETWORK.checksum(), NETWORK_CHECKSUM);
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod artifact_files;
mod checksum;
mod constants;
mod network;
mod packed;
mod shapes;
mod statics;
mod substitution;

pub use constants::{
    ADC_RATE_HZ, CHANNELS, CODE, COLUMNS, CONV1_CHANNELS, CONV2_CHANNELS, CodeFormat, ConvKernel,
    ELECTRODES, FC_PIECES, GAIN, GUARD_BITS, HAS_COMMANDS_ONLY, HAS_CONVOLUTIONS,
    HAS_INTERNAL_CLOCK, HAS_SHORTCUT, HOP, INPUT_MULTIPLIER, INPUT_SCALE_UV, IS_CASCADED, LABELS,
    LSB_NV, MODEL_ID, MainsFilter, NETWORK_ID, PACKED_COEFFICIENTS, PACKED_INPUT_PAIRS, PADS_SPACE,
    PADS_TIME, PHASES, POOL, ROWS, SECTIONS, STEP_RATE_HZ, STEPS, TAPS, WINDOW_CENTRE_US,
};
pub use network::{ConvWeights, Network};
pub use packed::{Packed, Slice};
pub use shapes::{
    CELL_PLANE, CELLS, CONV1_OUTPUTS, CONV1_PAIRS, CONV2_OUTPUTS, CONV2_PAIRS, Conv2, EDGE_STEPS,
    ELECTRODE_OUTPUTS, ELECTRODE_PAIRS, FC_PAIRS, HAS_NETWORK, HIDDEN, HIDDEN_INTERIOR,
    HIDDEN_PAIRS, INNER_STEPS, MARGIN, OPEN_WINDOWS, POOLED, POOLED_PAIRS, POOLED_STEPS,
    SHORTCUT_PAIRS, SHORTCUT_STEPS,
};
pub use statics::{
    CODE_FORMAT, CODE_SCALE, CODE_ZERO_POINT, GRID_CELL, MAINS_50, MAINS_60, Mains50, Mains60,
    NETWORK, PACKED, RESAMPLER, SUBSTITUTION,
};
pub use substitution::Substitution;

/// Checksum of the network, computed at compile time; compare with [`Network::checksum`].
#[allow(long_running_const_eval, reason = "a network of a megabyte takes the compiler a second")]
pub const NETWORK_CHECKSUM: u32 = NETWORK.checksum();

/// Checksum of the packed model, computed at compile time; compare with [`Packed::checksum`].
/// `None` without a packed model.
#[allow(
    long_running_const_eval,
    reason = "matrices of a hundred kilobytes take the compiler a second"
)]
pub const PACKED_CHECKSUM: Option<u32> = match &PACKED {
    Some(packed) => Some(packed.checksum()),
    None => None,
};

/// Checksum of the table of substitutions, computed at compile time; compare with
/// [`Substitution::checksum`]. `None` without a table.
pub const SUBSTITUTION_CHECKSUM: Option<u32> = match &SUBSTITUTION {
    Some(substitution) => Some(substitution.checksum()),
    None => None,
};

const _: () = {
    if let Some(packed) = &PACKED {
        assert!(packed.is_consistent());
    }
    if let Some(substitution) = &SUBSTITUTION {
        assert!(substitution.is_consistent());
    }
    assert!(RESAMPLER.is_consistent());
    assert!(NETWORK.is_consistent());
    let mut electrode = 0;
    while electrode < ELECTRODES {
        assert!((GRID_CELL[electrode] as usize) < CELLS, "every electrode has a cell");
        electrode += 1;
    }
    assert!(NETWORK.hop == HOP && CHANNELS >= ELECTRODES);
};

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;

    #[test]
    fn a_change_of_a_single_bit_changes_the_checksum() {
        assert_eq!(NETWORK.checksum(), NETWORK_CHECKSUM);
        if HAS_CONVOLUTIONS {
            let mut weights = *NETWORK.conv2.weights;
            weights[CONV2_PAIRS / 2].0 ^= 1 << 17;
            let mut network = NETWORK;
            network.conv2.weights = &weights;
            assert_ne!(network.checksum(), NETWORK_CHECKSUM);
        }
        let mut zero_point = *NETWORK.code_zero_point;
        if let Some(last) = zero_point.last_mut() {
            *last ^= 1;
            let mut network = NETWORK;
            network.code_zero_point = &zero_point;
            assert_ne!(network.checksum(), NETWORK_CHECKSUM);
        }
    }

    #[test]
    fn the_checked_in_manifest_is_up_to_date() {
        if option_env!("CORTICODE_ARTIFACT").is_some() {
            std::eprintln!(
                "SKIPPED: CORTICODE_ARTIFACT names another model than the checked-in one"
            );
            return;
        }
        let generated = include_str!(concat!(env!("OUT_DIR"), "/manifest.txt"));
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifest.txt");
        if std::env::var_os("UPDATE_MANIFEST").is_some() {
            fs::write(&path, generated).expect("signal/model/manifest.txt is writable");
        }
        let checked_in = fs::read_to_string(&path).unwrap_or_default();
        assert!(
            checked_in == generated,
            "signal/model/manifest.txt does not match signal/model/artifact; update it and review the numbers with \
             `UPDATE_MANIFEST=1 cargo test --package model` and `git diff signal/model/manifest.txt`"
        );
    }
}
