//! One channel through filters and resampler. `build.rs` has this file, too.

use fixed_dsp::{BLOCK, Cascade, DelayLine, Filter, Position, Resampler};

/// Outputs that a vector compares: these of 4 s, as `scipy_rates.csv` has them.
pub(crate) const PICKED: core::ops::Range<usize> = 384..512;
const EVERY: usize = 8;
/// So many.
pub(crate) const OUTPUTS: usize = (PICKED.end - PICKED.start) / EVERY;

/// Guard bits of the signal: counts x 2^5 (Q27.5).
pub(crate) const GUARD_BITS: u32 = 5;

/// What the filters give for these counts, sample by sample or in blocks; Q27.5.
pub(crate) fn outputs<const N: usize, const PHASES: usize, const TAPS: usize>(
    cascade: &Cascade<N>,
    resampler: &Resampler<PHASES, TAPS>,
    mut counts: impl Iterator<Item = i32>,
    in_blocks: bool,
) -> [i32; OUTPUTS] {
    let mut state = Cascade::<N>::REST;
    let mut line = DelayLine::<1, TAPS>::SILENCE;
    let mut position = Position::START;
    let mut picked = [0; OUTPUTS];
    let mut index = 0;
    while index < PICKED.end {
        let mut block: [i32; BLOCK] =
            core::array::from_fn(|_| counts.next().unwrap_or(0) << GUARD_BITS);
        if in_blocks {
            cascade.apply_blocks(
                core::slice::from_mut(&mut state),
                core::slice::from_mut(&mut block),
            );
        } else {
            block = block.map(|x| cascade.apply(&mut state, x));
        }
        for x in block {
            line.push(core::iter::once(x));
            let Some(phase) = resampler.advance(&mut position) else {
                continue;
            };
            let [output] = resampler.outputs(phase, &line);
            if PICKED.contains(&index) && index.is_multiple_of(EVERY) {
                picked[(index - PICKED.start) / EVERY] = output;
            }
            index += 1;
        }
    }
    picked
}
