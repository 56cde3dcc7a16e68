//! Input signals of the golden vectors. `build.rs` includes this file, to generate the same signals
//! on the PC.

use pipeline::{ELECTRODES, FeatureFilters, MAX_FEATURES, Sample};

/// Linear congruential generator with 32 bits of state (Numerical Recipes, section 7.1), whose
/// upper bits are the most random.
pub(crate) struct Noise(pub(crate) u32);

impl Noise {
    pub(crate) fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0
    }
}

/// Returns the samples of one channel, ADC counts: an offset of 20 mV plus noise of at most 46 uV.
/// The samples equal those in `signal/pipeline/tests/it/front_end/scipy_rates.py`.
pub(crate) fn counts() -> impl Iterator<Item = i32> {
    let mut noise = Noise(1);
    core::iter::from_fn(move || Some(894_784 + (noise.next() >> 20).cast_signed() - 2_048))
}

/// Number of samples for which a channel stays at one rail before it jumps to the other.
const AT_RAIL: usize = 100;

/// Returns endless samples of all channels. In each group of 16 channels, the first has noise over
/// the whole 24-bit range, the second jumps from rail to rail, and the third has an offset of 2.2
/// mV. The third and all others have noise of at most 183 uV.
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

/// Returns the filters of the golden features: random weights of at most 16 in magnitude, and a
/// band-pass of 8 to 30 Hz.
pub(crate) fn filters() -> FeatureFilters {
    let mut noise = Noise(11);
    let weights = [[(); ELECTRODES]; MAX_FEATURES];
    let weights = weights.map(|row| row.map(|()| ((noise.next() >> 27) as u8).wrapping_sub(16)));
    let sections = [
        [1_732_880_386, 6_412_710_145, -2_805_971_273],
        [1_732_880_386, 1_285_160_498, -1_524_016_507],
    ];
    let filters = FeatureFilters::new(1, sections, weights.as_flattened());
    filters.unwrap_or(FeatureFilters::NONE)
}
