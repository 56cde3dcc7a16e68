//! Predicts every electrode from the electrodes that are not excluded.

use int8_nn::{Pair, requantise};
use model::{ELECTRODE_OUTPUTS, ELECTRODE_PAIRS, ELECTRODES, GUARD_BITS, LSB_NV};

use super::{ElectrodeMask, MAX_EXCLUDED, Table};
use crate::front_end::Electrodes;

/// One value for each electrode, in quarters of a microvolt.
pub(super) type Quarters = [i16; ELECTRODES];

/// Largest magnitude of a value, quarters of a microvolt: 1,023.75 uV. Larger values are clipped, so
/// that every sum of products fits [`int8_nn::Linear`].
pub(super) const LARGEST: i32 = 4_095;

/// Nanovolts of one unit.
const UNIT_NV: f64 = 250.0;
/// Nanovolts of one unit of a filtered electrode, Q27.5.
const FILTERED_NV: f64 = LSB_NV as f64 / (1_u32 << GUARD_BITS) as f64;

/// Factor from a filtered electrode to quarters of a microvolt, Q0.32.
#[expect(
    clippy::cast_possible_truncation,
    reason = "below 2^31, as the assertion checks"
)]
const TO_QUARTERS: i32 = {
    let factor = FILTERED_NV / UNIT_NV;
    assert!(factor < 0.5, "the factor must fit Q0.32 with a sign");
    (factor * 4_294_967_296.0 + 0.5) as i32
};
/// Factor from quarters of a microvolt to a filtered electrode, Q24.8.
#[expect(clippy::cast_possible_truncation, reason = "some ten thousands")]
const FROM_QUARTERS: i64 = (UNIT_NV / FILTERED_NV * 256.0 + 0.5) as i64;

/// Returns filtered electrodes in quarters of a microvolt, clipped.
pub(super) fn quarters(electrodes: &Electrodes) -> Quarters {
    electrodes.map(|x| clipped(requantise(x, TO_QUARTERS)))
}

/// Returns a value in quarters of a microvolt as a filtered electrode, counts in Q27.5. The largest
/// value is 1 mV, which fits.
#[expect(clippy::cast_possible_truncation, reason = "as the comment states")]
pub(super) fn filtered(quarters: i16) -> i32 {
    ((i64::from(quarters) * FROM_QUARTERS + 128) >> 8) as i32
}

/// Number of sweeps over the excluded electrodes. With eight, twelve excluded electrodes are within
/// 6 % (RMS) of their conditional mean in the tests.
pub(super) const SWEEPS: usize = 8;
/// Fractional bits of the table's weights.
const WEIGHT_BITS: u32 = 7;

/// Number of pairs with one number for each excluded electrode.
const SLOT_PAIRS: usize = MAX_EXCLUDED.div_ceil(2);

/// The excluded electrodes, and their weights in the prediction of every electrode.
///
/// The electrodes are predicted in two parts: a product of the whole table with the measured
/// electrodes, in which excluded ones are 0, and the products of the excluded electrodes' weights
/// with their own predictions. The latter depend on each other, and follow by sweeps (Gauss-Seidel)
/// that start at 0.
#[derive(Clone, Debug)]
pub(super) struct Fill {
    excluded: ElectrodeMask,
    /// The excluded electrode in each slot; `None` if the slot is free.
    slots: [Option<u8>; MAX_EXCLUDED],
    /// For each electrode, the weights from the electrodes of all slots to it; 0 from free slots.
    weights: [[Pair; SLOT_PAIRS]; ELECTRODES],
}

/// Number of electrodes, which fits a byte.
#[expect(clippy::cast_possible_truncation, reason = "at most 64")]
const ELECTRODE_COUNT: u8 = ELECTRODES as u8;

impl Fill {
    /// A fill without excluded electrodes.
    pub(super) const NONE: Self = Self {
        excluded: 0,
        slots: [None; MAX_EXCLUDED],
        weights: [[Pair::ZERO; SLOT_PAIRS]; ELECTRODES],
    };

    /// Returns the excluded electrodes.
    pub(super) const fn excluded(&self) -> ElectrodeMask {
        self.excluded
    }

    /// Excludes electrodes, as many as there are free slots, the first of the montage first.
    pub(super) fn exclude(&mut self, electrodes: ElectrodeMask, table: &Table<'_>) {
        let new = electrodes & !self.excluded;
        for electrode in (0..ELECTRODE_COUNT).filter(|electrode| new >> electrode & 1 != 0) {
            let Some(slot) = self.slots.iter().position(Option::is_none) else {
                return;
            };
            self.slots[slot] = Some(electrode);
            self.excluded |= 1 << electrode;
            self.set_weights(slot, |output| {
                table.prediction.weight(electrode.into(), output)
            });
        }
    }

    /// Excludes electrodes as [`Self::exclude`] does. If there are too few free slots, the exclusion
    /// of other electrodes ends.
    pub(super) fn exclude_first(&mut self, electrodes: ElectrodeMask, table: &Table<'_>) {
        while (self.excluded | electrodes).count_ones() as usize > MAX_EXCLUDED
            && let others = self.excluded & !electrodes
            && others != 0
        {
            self.readmit(others & others.wrapping_neg());
        }
        self.exclude(electrodes, table);
    }

    /// Ends the exclusion of electrodes.
    pub(super) fn readmit(&mut self, electrodes: ElectrodeMask) {
        for slot in 0..MAX_EXCLUDED {
            let ends = |electrode: u8| electrodes >> electrode & 1 != 0;
            if self.slots[slot].is_some_and(ends) {
                self.slots[slot] = None;
                self.set_weights(slot, |_| 0);
            }
        }
        self.excluded &= !electrodes;
    }

    /// Sets the weights from the electrode of a slot to each electrode.
    fn set_weights(&mut self, slot: usize, weight: impl Fn(usize) -> i8) {
        for (electrode, weights) in self.weights.iter_mut().enumerate() {
            if let Some(pair) = weights.get_mut(slot / 2) {
                *pair = pair.with(slot % 2, weight(electrode).into());
            }
        }
    }

    /// Returns the prediction of every electrode from the `measured` ones that are not excluded.
    #[inline(never)]
    pub(super) fn predict(&self, measured: &Quarters, table: &Table<'_>) -> Quarters {
        let mut inputs = [Pair::ZERO; ELECTRODE_PAIRS];
        let kept = measured
            .iter()
            .enumerate()
            .map(|(electrode, &value)| value * i16::from(self.excluded >> electrode & 1 == 0));
        Pair::fill(&mut inputs, kept);
        let mut sums = [0; ELECTRODE_OUTPUTS];
        // False only for a table of another size, which does not compile.
        let _ = table.prediction.try_accumulate(&inputs, &mut sums);
        let values = self.sweep(&sums);
        let mut predicted = [0; ELECTRODES];
        for (predicted, (weights, &sum)) in predicted.iter_mut().zip(self.weights.iter().zip(&sums))
        {
            *predicted = rounded(dot(weights, &values, sum));
        }
        // The last sweep's value, which one more product would change.
        for (slot, electrode) in self.slots.iter().enumerate() {
            if let Some(predicted) = predicted.get_mut(index(*electrode)) {
                *predicted = values[slot / 2].get()[slot % 2];
            }
        }
        predicted
    }

    /// Returns the prediction of the electrode in each slot; `sums` are the products of the table
    /// with all other electrodes.
    fn sweep(&self, sums: &[i32; ELECTRODE_OUTPUTS]) -> [Pair; SLOT_PAIRS] {
        let slots = self.slots.map(|electrode| {
            let weights = self.weights.get(index(electrode)).copied();
            let sum = sums.get(index(electrode)).copied();
            (
                weights.unwrap_or([Pair::ZERO; SLOT_PAIRS]),
                sum.unwrap_or(0),
            )
        });
        let mut values = [Pair::ZERO; SLOT_PAIRS];
        for _ in 0..SWEEPS {
            for (slot, (weights, sum)) in slots.iter().enumerate() {
                let value = rounded(dot(weights, &values, *sum));
                values[slot / 2] = values[slot / 2].with(slot % 2, value);
            }
        }
        values
    }
}

/// Returns the index of a slot's electrode; of a free slot, one that no electrode has.
fn index(electrode: Option<u8>) -> usize {
    electrode.map_or(usize::MAX, usize::from)
}

/// Returns `sum` plus the products of weights and values.
#[inline]
fn dot(weights: &[Pair; SLOT_PAIRS], values: &[Pair; SLOT_PAIRS], sum: i32) -> i32 {
    let products = weights.iter().zip(values);
    products.fold(sum, |sum, (weight, value)| weight.multiply_add(*value, sum))
}

/// Divides a sum of products by the scale of the weights, rounded half up, and clips. No table makes
/// the sums overflow: they stay below 2^28.
const fn rounded(sum: i32) -> i16 {
    clipped((sum + (1 << (WEIGHT_BITS - 1))) >> WEIGHT_BITS)
}

#[expect(clippy::cast_possible_truncation, reason = "clamped")]
const fn clipped(value: i32) -> i16 {
    if value > LARGEST {
        LARGEST as i16
    } else if value < -LARGEST {
        -LARGEST as i16
    } else {
        value as i16
    }
}
