//! Byte layout of the table and of the time steps in the input and output files of the image
//! `substitution`.

use int8_nn::{Linear, Pair};
use model::{ELECTRODE_OUTPUTS, ELECTRODE_PAIRS, ELECTRODES, Substitution};
use pipeline::{FeatureFilters, Step};

/// A table of substitutions, which stands at the start of the input file.
#[derive(Debug)]
pub struct OwnedTable {
    /// Weights, packed by [`Linear::pack_weights`].
    pub weights: [Pair; ELECTRODE_PAIRS * ELECTRODE_OUTPUTS / 2],
    /// Typical mean square of each electrode's innovation (the electrode minus its prediction), in
    /// the unit of the artifact, (1/16 uV)^2.
    pub innovation: [i32; ELECTRODES],
}

/// Length of a table in the input file, bytes.
pub const TABLE_BYTES: usize = 4 * (ELECTRODE_PAIRS * ELECTRODE_OUTPUTS / 2 + ELECTRODES);

/// Length of a step in both files, bytes: the electrodes (4 bytes each), then a mask of 8 bytes. In
/// the input file, the mask has the channels at the rail; in the output file, the excluded
/// electrodes.
pub const STEP_BYTES: usize = 4 * ELECTRODES + 8;

/// Samples for each step: 512 Hz over 128 Hz.
pub const SAMPLES_PER_STEP: usize = model::ADC_RATE_HZ as usize / model::STEP_RATE_HZ as usize;

impl OwnedTable {
    /// Returns the table as the pipeline expects it.
    pub const fn borrow(&self) -> Substitution<'_> {
        Substitution {
            prediction: Linear {
                inputs: ELECTRODE_PAIRS,
                outputs: ELECTRODE_OUTPUTS,
                weights: &self.weights,
            },
            innovation: &self.innovation,
        }
    }

    /// Reads a table from the bytes of the input file.
    pub fn from_bytes(bytes: &[u8; TABLE_BYTES]) -> Self {
        let (weights, innovation) =
            bytes.as_chunks().0.split_at(ELECTRODE_PAIRS * ELECTRODE_OUTPUTS / 2);
        Self {
            weights: core::array::from_fn(|at| Pair(u32::from_le_bytes(weights[at]))),
            innovation: core::array::from_fn(|at| i32::from_le_bytes(innovation[at])),
        }
    }
}

/// Returns a step with the electrodes and the mask of channels at the rail, read from the input
/// file.
pub fn from_bytes(bytes: &[u8; STEP_BYTES]) -> Step {
    let (electrodes, mask) = bytes.split_at(4 * ELECTRODES);
    let electrodes = electrodes.as_chunks().0;
    let mut saturated = [0; 8];
    saturated.copy_from_slice(mask);
    let electrodes = core::array::from_fn(|at| i32::from_le_bytes(electrodes[at]));
    let (plane, clipped) = pipeline::quantise(&electrodes);
    Step { electrodes, plane, clipped, saturated: u64::from_le_bytes(saturated), ..Step::SILENCE }
}

/// Returns the bytes of a step: its electrodes, then `mask`.
pub fn to_bytes(step: &Step, mask: u64) -> [u8; STEP_BYTES] {
    let mut bytes = [0; STEP_BYTES];
    let electrodes = step.electrodes.map(i32::to_le_bytes);
    let (values, end) = bytes.split_at_mut(4 * ELECTRODES);
    values.copy_from_slice(electrodes.as_flattened());
    end.copy_from_slice(&mask.to_le_bytes());
    bytes
}

/// Returns six spatial filters, the default number of `trainer classify`, with weights from -16 to
/// 16, and a band-pass of 8 to 30 Hz.
///
/// # Panics
/// If the filters are out of range, which does not happen with any montage.
pub fn any_filters() -> FeatureFilters {
    let mut weights = [[0; ELECTRODES]; 6];
    let mut next = 0_u8;
    for weight in weights.as_flattened_mut() {
        *weight = (next % 33).wrapping_sub(16);
        next = next.wrapping_add(13);
    }
    let sections = [
        [1_732_880_386, 6_412_710_145, -2_805_971_273],
        [1_732_880_386, 1_285_160_498, -1_524_016_507],
    ];
    let filters = FeatureFilters::new(1, sections, weights.as_flattened());
    filters.expect("weights of 16 at most")
}
