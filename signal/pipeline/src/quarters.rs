//! Electrodes in quarters of a microvolt: the inputs of 8-bit matrices.

use int8_nn::{Pair, requantise};
use model::{ELECTRODE_PAIRS, GUARD_BITS, LSB_NV};

use crate::front_end::Electrodes;

/// One value per electrode, in quarters of a microvolt, padded with zeros to a matrix's inputs.
pub(crate) type Quarters = [i16; 2 * ELECTRODE_PAIRS];

/// Number of bits of a value: -4,096..=4,095 quarters of a microvolt, which is -1,024 to 1,023.75
/// uV. Other values saturate, so that every sum of products fits [`int8_nn::Linear`].
const VALUE_BITS: u32 = 13;
/// Largest magnitude of a value.
pub(crate) const LARGEST: i32 = 1 << (VALUE_BITS - 1);

/// Nanovolts of one unit.
const UNIT_NV: f64 = 250.0;
/// Nanovolts of one unit of a filtered electrode, Q27.5.
const FILTERED_NV: f64 = LSB_NV as f64 / (1_u32 << GUARD_BITS) as f64;

/// Factor from a filtered electrode to quarters of a microvolt, Q0.32.
#[expect(clippy::cast_possible_truncation, reason = "below 2^31, as the assertion checks")]
const TO_QUARTERS: i32 = {
    let factor = FILTERED_NV / UNIT_NV;
    assert!(factor < 0.5, "the factor must fit Q0.32 with a sign");
    (factor * 4_294_967_296.0 + 0.5) as i32
};
/// Factor from quarters of a microvolt to a filtered electrode, Q24.8.
#[expect(clippy::cast_possible_truncation, reason = "some ten thousands")]
const FROM_QUARTERS: i64 = (UNIT_NV / FILTERED_NV * 256.0 + 0.5) as i64;

/// Returns a function that converts a filtered electrode to quarters of a microvolt, saturated.
#[inline]
fn to_quarters() -> impl Fn(i32) -> i16 {
    // The compiler would replace a multiplication by a known constant by several instructions. With
    // a factor that `black_box` hides, it uses a single SMMULR.
    let factor = core::hint::black_box(TO_QUARTERS);
    move |x| saturated(requantise(x, factor))
}

/// Returns filtered electrodes in quarters of a microvolt, saturated.
pub(crate) fn quarters(electrodes: &Electrodes) -> Quarters {
    let to_quarters = to_quarters();
    let mut quarters = [0; _];
    for (quarters, &x) in quarters.iter_mut().zip(electrodes) {
        *quarters = to_quarters(x);
    }
    quarters
}

/// Converts a value in quarters of a microvolt to a filtered electrode, counts in Q27.5. The
/// largest value, 1 mV, fits 32 bits.
#[expect(clippy::cast_possible_truncation, reason = "as the comment states")]
pub(crate) fn filtered(quarters: i16) -> i32 {
    ((i64::from(quarters) * FROM_QUARTERS + 128) >> 8) as i32
}

/// Converts filtered electrodes to quarters of a microvolt, saturated, and writes them as pairs,
/// the inputs of a matrix. Pairs beyond the electrodes are unchanged.
#[inline]
pub(crate) fn write_quarters(electrodes: &Electrodes, pairs: &mut [Pair; ELECTRODE_PAIRS]) {
    let to_quarters = to_quarters();
    let (two, last) = electrodes.as_chunks::<2>();
    for (pair, two) in pairs.iter_mut().zip(two) {
        *pair = Pair::new(two.map(&to_quarters));
    }
    if let (Some(pair), [last]) = (pairs.get_mut(two.len()), last) {
        *pair = Pair::new([to_quarters(*last), 0]);
    }
}

/// Returns the values as pairs, the inputs of a matrix.
#[inline]
pub(crate) fn pairs(quarters: &Quarters) -> [Pair; ELECTRODE_PAIRS] {
    core::array::from_fn(|pair| Pair::new([quarters[2 * pair], quarters[2 * pair + 1]]))
}

/// Limits a value to [`VALUE_BITS`] bits (SSAT).
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "clamped")]
pub(crate) fn saturated(value: i32) -> i16 {
    value.clamp(-LARGEST, LARGEST - 1) as i16
}
