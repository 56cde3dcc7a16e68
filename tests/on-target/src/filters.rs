//! Checks the filters and resamplers that model-gen designs for several ADC rates.

use fixed_dsp::{Cascade, Resampler};

use crate::{
    chain::{self, OUTPUTS},
    mismatch::{Mismatch, expect_equal, expect_near},
    signal,
};

/// Filters and a resampler, and their expected outputs for [`signal::counts`], Q27.5.
#[derive(Debug)]
pub(crate) struct Filtered<const N: usize, const PHASES: usize, const TAPS: usize> {
    pub(crate) cascade: Cascade<N>,
    pub(crate) resampler: Resampler<PHASES, TAPS>,
    /// Expected outputs from scipy, computed in float64 and rounded to Q27.5.
    pub(crate) scipy: [i32; OUTPUTS],
    /// Outputs that the PC computes with the same filters; the device's must be equal.
    pub(crate) bits: [i32; OUTPUTS],
}

/// Largest permitted difference from scipy's outputs, 0.08 uV, in units of Q27.5 (22.35 nV x 2^-5),
/// as in `signal/pipeline/tests/it/front_end.rs`. It covers the rounding of counts and
/// coefficients. The largest difference measured in that test is 0.040 uV.
const SCIPY_TOLERANCE: u64 = 114;

/// Checks that the outputs equal the PC's and are close to scipy's. Not inlined, to save flash, of
/// which a NUCLEO-F446RE has little left besides the model.
#[inline(never)]
pub(crate) fn check<const N: usize, const PHASES: usize, const TAPS: usize>(
    filtered: &Filtered<N, PHASES, TAPS>,
) -> Result<(), Mismatch> {
    let Filtered { cascade, resampler, .. } = filtered;
    let [singles, blocks] = [false, true]
        .map(|in_blocks| chain::outputs(cascade, resampler, signal::counts(), in_blocks));
    expect_equal("outputs", &filtered.bits, &singles)?;
    expect_equal("outputs of blocks", &filtered.bits, &blocks)?;
    expect_near("scipy's outputs", SCIPY_TOLERANCE, &filtered.scipy, &singles)
}
