//! Filters and resampler, designed by model-gen for rates that the built-in model may not have.

use fixed_dsp::{Cascade, Resampler};

use crate::{
    Mismatch,
    chain::{self, OUTPUTS},
    mismatch::{near, same},
    signal,
};

/// Filters, and what they give for [`signal::counts`]; Q27.5.
#[derive(Debug)]
pub(crate) struct Filtered<const N: usize, const PHASES: usize, const TAPS: usize> {
    pub(crate) cascade: Cascade<N>,
    pub(crate) resampler: Resampler<PHASES, TAPS>,
    /// scipy's, in float64, rounded.
    pub(crate) scipy: [i32; OUTPUTS],
    /// The PC's, bit for bit.
    pub(crate) bits: [i32; OUTPUTS],
}

/// 0.08 uV, as in `pipeline/tests/front_end/rates.rs`, of 22.35 nV x 2^-5 each; rounding of counts and
/// coefficients. Measured there: 0.040 uV.
const SCIPY_TOLERANCE: u64 = 114;

/// Not inlined: a NUCLEO-F446RE has little flash beside the model.
#[inline(never)]
pub(crate) fn check<const N: usize, const PHASES: usize, const TAPS: usize>(
    filtered: &Filtered<N, PHASES, TAPS>,
) -> Result<(), Mismatch> {
    let Filtered {
        cascade, resampler, ..
    } = filtered;
    let [steps, blocks] = [false, true]
        .map(|in_blocks| chain::outputs(cascade, resampler, signal::counts(), in_blocks));
    same("outputs", &filtered.bits, &steps)?;
    same("outputs of blocks", &filtered.bits, &blocks)?;
    near("scipy's outputs", SCIPY_TOLERANCE, &filtered.scipy, &steps)
}
