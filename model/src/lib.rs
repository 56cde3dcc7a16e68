//! What training decided, as constants: filters, montage, scales and the int8 encoder.
//!
//! Everything below [`MainsFilter`] is generated at build time by model-gen, which proves its ranges,
//! from the files in `artifact/`, or in the folder that the environment variable `CORTICODE_ARTIFACT`
//! names. `manifest.txt` shows the numbers of the former that a person wants to see.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod code_format;
mod network;

use fixed_dsp::{Cascade, Coefficient, Design, Resampler, Section};
use int8_nn::Pair;

pub use code_format::CodeFormat;
pub use network::{
    CELL_PLANE, CONV1_OUTPUTS, CONV1_PAIRS, CONV2_OUTPUTS, CONV2_PAIRS, ConvWeights, EDGE_STEPS,
    ELECTRODE_PAIRS, FC_PAIRS, HIDDEN, HIDDEN_INTERIOR, HIDDEN_PAIRS, INNER_STEPS, MARGIN, Network,
    POOLED, POOLED_PAIRS, POOLED_STEPS, SHORTCUT_PAIRS, SHORTCUT_STEPS,
};

/// Electrodes of the montage; electrode `e` is wired to ADC channel `e`.
pub const ELECTRODES: usize = 61;
/// Rows of the scalp grid.
pub const ROWS: usize = 10;
/// Columns of the scalp grid.
pub const COLUMNS: usize = 9;
/// Cells of the scalp grid, row-major; a cell without an electrode is always 0.
pub const CELLS: usize = ROWS * COLUMNS;
/// Time steps of a window.
pub const STEPS: usize = 16;
/// Numbers in a code.
pub const CODE: usize = 128;

/// The filters in front of the decimator for one mains frequency.
#[derive(Clone, Copy, Debug)]
pub struct MainsFilter {
    /// Mains frequency that is notched out, Hz.
    pub mains_hz: u8,
    /// The sections; samples are counts in Q27.5.
    pub cascade: Cascade<SECTIONS>,
    /// Group delay of sections and resampler at 10 Hz, microseconds.
    pub group_delay_us: u32,
    /// Group delay plus [`WINDOW_CENTRE_US`]: a code's device time minus this is the moment on the
    /// scalp in the middle of its window.
    pub scalp_delay_us: u32,
    /// ADC samples until a step has decayed to 1e-4 of its height behind the resampler.
    pub settling_samples: u32,
    /// The chain in words.
    pub description: &'static str,
}

include!(concat!(env!("OUT_DIR"), "/generated.rs"));

/// The sum over the network as it was built.
#[allow(
    long_running_const_eval,
    reason = "a network of a megabyte takes the compiler a second"
)]
pub const NETWORK_SUM: u32 = NETWORK.sum();

const _: () = {
    assert!(RESAMPLER.is_consistent());
    assert!(NETWORK.is_consistent());
    let mut electrode = 0;
    while electrode < ELECTRODES {
        assert!(
            (GRID_CELL[electrode] as usize) < CELLS,
            "every electrode has a cell"
        );
        electrode += 1;
    }
    assert!(NETWORK.hop == HOP && CHANNELS >= ELECTRODES);
};

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use super::*;

    #[test]
    fn a_single_bit_of_any_weight_changes_the_sum() {
        assert_eq!(NETWORK.sum(), NETWORK_SUM);
        if HAS_CONVOLUTIONS {
            let mut weights = *NETWORK.conv2.weights;
            weights[CONV2_PAIRS / 2].0 ^= 1 << 17;
            let mut network = NETWORK;
            network.conv2.weights = &weights;
            assert_ne!(network.sum(), NETWORK_SUM);
        }
        let mut zero_point = *NETWORK.code_zero_point;
        zero_point[CODE - 1] ^= 1;
        let mut network = NETWORK;
        network.code_zero_point = &zero_point;
        assert_ne!(network.sum(), NETWORK_SUM);
    }

    #[test]
    fn the_checked_in_manifest_is_that_of_the_artifact() {
        if option_env!("CORTICODE_ARTIFACT").is_some() {
            std::eprintln!("SKIPPED: the manifest of another model than the checked-in one");
            return;
        }
        let generated = include_str!(concat!(env!("OUT_DIR"), "/manifest.txt"));
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("manifest.txt");
        if std::env::var_os("UPDATE_MANIFEST").is_some() {
            fs::write(&path, generated).expect("model/manifest.txt is writable");
        }
        let checked_in = fs::read_to_string(&path).unwrap_or_default();
        assert!(
            checked_in == generated,
            "model/manifest.txt is not that of model/artifact; look at the new numbers with \
             `UPDATE_MANIFEST=1 cargo test --package model` and `git diff model/manifest.txt`"
        );
    }
}
