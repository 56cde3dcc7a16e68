//! Inputs that everybody can make: device, PC and `scipy_rates.py`. `build.rs` has this file, too.

use pipeline::Sample;

/// Numerical Recipes' linear congruential generator (section 7.1), 32 bits, the upper ones the better.
pub(crate) struct Noise(pub(crate) u32);

impl Noise {
    pub(crate) fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0
    }
}

/// One channel: 20 mV of offset and noise of 46 uV at most, counts. Those of
/// `pipeline/tests/front_end/scipy_rates.py`.
pub(crate) fn counts() -> impl Iterator<Item = i32> {
    let mut noise = Noise(1);
    core::iter::from_fn(move || Some(894_784 + (noise.next() >> 20).cast_signed() - 2_048))
}

/// Samples a channel stands at one rail before it goes to the other.
const AT_RAIL: usize = 100;

/// All channels. Of sixteen, one has noise of 24 bits, one goes from rail to rail, one has 2.2 mV of offset;
/// they and all others have noise of 183 uV at most.
pub(crate) fn samples() -> impl Iterator<Item = Sample> {
    let mut noise = Noise(7);
    (0..).map(move |index: usize| Sample {
        counts: core::array::from_fn(|channel| {
            let any = noise.next().cast_signed() >> 8;
            match channel % 16 {
                0 => any,
                1 if (index / AT_RAIL).is_multiple_of(2) => Sample::MAX,
                1 => -Sample::MAX - 1,
                2 => 100_000 + (any >> 10),
                _ => any >> 10,
            }
        }),
    })
}
