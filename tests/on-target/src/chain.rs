//! Runs filters and a resampler on one channel. `build.rs` includes this file, to run the same code
//! on the PC.

use fixed_dsp::{BLOCK, Cascade, DelayLine, Filter, Position, Resampler};

/// Range of output indices in which every [`EVERY`]th output is compared, as in `scipy_rates.csv`:
/// the fourth second at 128 outputs per second.
pub(crate) const COMPARED: core::ops::Range<usize> = 384..512;
const EVERY: usize = 8;
/// Number of outputs that are compared for each filter.
pub(crate) const OUTPUTS: usize = (COMPARED.end - COMPARED.start) / EVERY;

/// Number of fraction bits of a signal in counts: Q27.5.
pub(crate) const GUARD_BITS: u32 = 5;

/// Filters and resamples `counts`, and returns the compared outputs, Q27.5. If `in_blocks` is true,
/// the filters process blocks of samples, otherwise single samples.
pub(crate) fn outputs<const N: usize, const PHASES: usize, const TAPS: usize>(
    cascade: &Cascade<N>,
    resampler: &Resampler<PHASES, TAPS>,
    mut counts: impl Iterator<Item = i32>,
    in_blocks: bool,
) -> [i32; OUTPUTS] {
    let mut state = Cascade::<N>::REST;
    let mut line = DelayLine::<1, TAPS>::SILENCE;
    let mut position = Position::START;
    let mut compared = [0; OUTPUTS];
    let mut index = 0;
    while index < COMPARED.end {
        let mut block: [i32; BLOCK] =
            core::array::from_fn(|_| counts.next().unwrap_or(0) << GUARD_BITS);
        if in_blocks {
            cascade
                .apply_blocks(core::slice::from_mut(&mut state), core::slice::from_mut(&mut block));
        } else {
            block = block.map(|x| cascade.apply(&mut state, x));
        }
        for x in block {
            line.push(core::iter::once(x));
            let Some(phase) = resampler.advance(&mut position) else {
                continue;
            };
            let [output] = resampler.outputs(phase, &line);
            if COMPARED.contains(&index) && index.is_multiple_of(EVERY) {
                compared[(index - COMPARED.start) / EVERY] = output;
            }
            index += 1;
        }
    }
    compared
}
