//! Predicts every electrode from the electrodes that are not excluded.

use int8_nn::{Linear, Pair};
use model::{ELECTRODE_OUTPUTS, ELECTRODES};

use super::{ElectrodeMask, MAX_EXCLUDED, Table};
use crate::quarters::{Quarters, pairs, saturated};

/// Number of sweeps over the excluded electrodes. In the tests, eight sweeps bring the predictions
/// of twelve excluded electrodes within 6 % (RMS) of their conditional mean.
pub(super) const SWEEPS: usize = 8;
/// Fractional bits of the table's weights.
const WEIGHT_BITS: u32 = 7;

/// Number of pairs that hold the values of all slots, two slots per pair.
const SLOT_PAIRS: usize = MAX_EXCLUDED / 2;
/// Number of input pairs of the matrix from all slots to every electrode: a multiple of 8, as
/// [`Linear`] requires.
const SLOT_INPUTS: usize = SLOT_PAIRS.next_multiple_of(8);

/// One value for each slot, padded with zeros to [`SLOT_INPUTS`] pairs.
type Slots = [Pair; SLOT_INPUTS];

/// The excluded electrodes, and their weights in the prediction of every electrode.
///
/// The electrodes are predicted in two parts: a product of the whole table with the measured
/// electrodes, in which excluded ones are 0, and the products of the excluded electrodes' weights
/// with their own predictions. The predictions of excluded electrodes depend on each other, so they
/// are computed by Gauss-Seidel sweeps that start at 0.
#[derive(Clone, Debug)]
pub(super) struct Fill {
    excluded: ElectrodeMask,
    /// The excluded electrode in each slot, counted from 1, or [`FREE`].
    slots: [u8; MAX_EXCLUDED],
    /// Weights from the electrodes of all slots to every electrode, packed for [`Linear`]. Weights
    /// of a free slot have no effect, because the slot's value is 0.
    weights: [Pair; SLOT_INPUTS * ELECTRODE_OUTPUTS / 2],
    /// For each slot, the weights from the electrodes of all slots to this slot's electrode; 0 for
    /// a free slot.
    among_slots: [[Pair; SLOT_PAIRS]; MAX_EXCLUDED],
}

/// Content of a free slot. It is 0, so that the initial state, all zeros, takes no flash.
const FREE: u8 = 0;

const _: () = assert!(MAX_EXCLUDED == 12, "a sweep has one call for each pair of slots");

impl Fill {
    pub(super) const NONE: Self = Self {
        excluded: 0,
        slots: [FREE; MAX_EXCLUDED],
        weights: [Pair::ZERO; SLOT_INPUTS * ELECTRODE_OUTPUTS / 2],
        among_slots: [[Pair::ZERO; SLOT_PAIRS]; MAX_EXCLUDED],
    };

    pub(super) const fn excluded(&self) -> ElectrodeMask {
        self.excluded
    }

    /// Excludes electrodes in the order of the montage, until all slots are taken.
    #[expect(clippy::cast_possible_truncation, reason = "the index of one of 64 bits")]
    pub(super) fn exclude(&mut self, electrodes: ElectrodeMask, table: &Table<'_>) {
        let mut new = electrodes & !self.excluded;
        for slot in 0..MAX_EXCLUDED {
            if new == 0 {
                break;
            }
            if self.slots[slot] == FREE {
                let electrode = new.trailing_zeros() as u8;
                self.slots[slot] = electrode + 1;
                self.excluded |= 1 << electrode;
                new &= new - 1;
                let weights = &mut self.weights;
                (table.prediction).copy_input(electrode.into(), weights, SLOT_INPUTS, slot);
            }
        }
        self.gather_weights();
    }

    /// Excludes electrodes as [`Self::exclude`] does. If there are too few free slots, readmits
    /// other electrodes first.
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
        let indices = self.indices();
        let slots = self.slots.iter_mut().zip(&mut self.among_slots);
        for (index, (slot, weights)) in indices.into_iter().zip(slots) {
            if index < ELECTRODES && electrodes >> index & 1 != 0 {
                *slot = FREE;
                *weights = [Pair::ZERO; SLOT_PAIRS];
            }
        }
        self.excluded &= !electrodes;
    }

    /// Copies the weights between the electrodes of the slots to `among_slots`.
    fn gather_weights(&mut self) {
        let matrix = matrix(&self.weights);
        for (index, weights) in self.indices().into_iter().zip(&mut self.among_slots) {
            *weights = core::array::from_fn(|pair| matrix.weights_from(pair, index));
        }
    }

    /// Returns the index of the electrode in each slot, and for a free slot an index that no
    /// electrode has.
    pub(super) fn indices(&self) -> [usize; MAX_EXCLUDED] {
        (self.slots).map(|number| usize::from(number).wrapping_sub(1))
    }

    /// Returns the prediction of every electrode from the `measured` values of the electrodes that
    /// are not excluded.
    #[inline(never)]
    pub(super) fn predict(&self, measured: &Quarters, table: &Table<'_>) -> Quarters {
        let mut inputs = pairs(measured);
        for electrode in self.indices() {
            if let Some(pair) = inputs.get_mut(electrode / 2) {
                *pair = pair.with(electrode % 2, 0);
            }
        }
        let mut sums = [HALF; ELECTRODE_OUTPUTS];
        // `try_accumulate` returns false only for a table of another size, and a model with such a
        // table does not compile.
        let _ = table.prediction.try_accumulate(&inputs, &mut sums);
        let values = self.sweep(&sums);
        let _ = matrix(&self.weights).try_accumulate(&values, &mut sums);
        let mut predicted = [0; _];
        for (predicted, &sum) in predicted.iter_mut().zip(&sums[..ELECTRODES]) {
            *predicted = saturated(sum >> WEIGHT_BITS);
        }
        // Excluded electrodes get the value of the last sweep instead of the sum above, which
        // amounts to a further sweep.
        for (slot, electrode) in self.indices().into_iter().enumerate() {
            if let Some(predicted) = predicted.get_mut(electrode) {
                *predicted = values[slot / 2].get()[slot % 2];
            }
        }
        predicted
    }

    /// Returns the prediction of the electrode in each slot, 0 for a free slot. Each element of
    /// `sums` belongs to one electrode: [`HALF`] plus the sum of its weights times the values of
    /// the electrodes that are not excluded.
    #[inline]
    fn sweep(&self, sums: &[i32; ELECTRODE_OUTPUTS]) -> Slots {
        let sums = (self.indices()).map(|electrode| sums.get(electrode).copied().unwrap_or(0));
        let mut values = [Pair::ZERO; SLOT_PAIRS];
        for _ in 0..SWEEPS {
            self.predict_pair::<0>(&sums, &mut values);
            self.predict_pair::<1>(&sums, &mut values);
            self.predict_pair::<2>(&sums, &mut values);
            self.predict_pair::<3>(&sums, &mut values);
            self.predict_pair::<4>(&sums, &mut values);
            self.predict_pair::<5>(&sums, &mut values);
        }
        let mut slots = [Pair::ZERO; SLOT_INPUTS];
        slots[..SLOT_PAIRS].copy_from_slice(&values);
        slots
    }

    /// Predicts the electrodes of two slots, one after the other, from the values of all slots. A
    /// constant index keeps the values in registers, which saves a third of the sweeps'
    /// instructions.
    #[inline]
    fn predict_pair<const PAIR: usize>(
        &self,
        sums: &[i32; MAX_EXCLUDED],
        values: &mut [Pair; SLOT_PAIRS],
    ) {
        for slot in [2 * PAIR, 2 * PAIR + 1] {
            let products = self.among_slots[slot].iter().zip(&*values);
            let sum =
                products.fold(sums[slot], |sum, (weight, value)| weight.multiply_add(*value, sum));
            values[PAIR] = values[PAIR].with(slot % 2, saturated(sum >> WEIGHT_BITS));
        }
    }
}

/// Returns the matrix from all slots to every electrode.
const fn matrix(weights: &[Pair]) -> Linear<'_> {
    Linear { inputs: SLOT_INPUTS, outputs: ELECTRODE_OUTPUTS, weights }
}

/// Half of the weights' scale: a sum that starts at this value is rounded half up by the shift.
///
/// No table makes the sums overflow: the sums over all electrodes stay below 2^23, and so do the
/// sums over all [`MAX_EXCLUDED`] slots, whose weights have a magnitude of at most 127.
const HALF: i32 = 1 << (WEIGHT_BITS - 1);
