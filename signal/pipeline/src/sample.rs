//! One sample of the ADC, one time step, and its int8 plane on the scalp grid.

use int8_nn::{requantise, saturate_i8};
use model::{CELLS, CHANNELS, ELECTRODES, GRID_CELL, INPUT_MULTIPLIER};

use crate::front_end::Electrodes;

/// The counts of all ADC channels at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Counts by ADC channel: 24-bit two's complement in 32 bits, |count| <= 2^23.
    pub counts: [i32; CHANNELS],
}

impl Sample {
    /// Largest count of a 24-bit converter; the smallest is `-MAX - 1`. A channel with either count
    /// is at the rail.
    pub const MAX: i32 = (1 << 23) - 1;

    /// Returns 1 for a count at the rail, otherwise 0.
    #[inline]
    pub(crate) const fn at_rail(count: i32) -> u32 {
        // The XOR complements negative counts. Both rails become MAX, all other counts smaller
        // numbers; only MAX + 1 has bit 23 set.
        ((count ^ (count >> 31)) + 1).cast_unsigned() >> 23
    }

    /// Returns the channels that are at the rail; bit n is channel n.
    #[inline]
    pub fn channels_at_rail(&self) -> u64 {
        const { assert!(CHANNELS <= 64, "the mask has 64 bits") };
        // Two halves of 32 bits, because a Cortex-M needs several instructions to shift 64 bits.
        let (low, high) = self.counts.split_at(if CHANNELS < 32 { CHANNELS } else { 32 });
        let [low, high] = [low, high].map(|counts| {
            let bits = counts.iter().rev().map(|&count| Self::at_rail(count));
            bits.fold(0, |rails, bit| rails << 1 | bit)
        });
        u64::from(high) << 32 | u64::from(low)
    }
}

impl Default for Sample {
    /// Returns a sample of zeros.
    fn default() -> Self {
        Self { counts: [0; CHANNELS] }
    }
}

/// One time step at 128 Hz: the filtered and quantised values of the electrodes, and status such
/// as clipped values, channels at the rail and settling filters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Index of the last ADC sample at or before the step, counted from the start of the run.
    pub sample: u64,
    /// Time from the ADC sample `sample` to the step, microseconds; 0 if the ADC's rate is a
    /// multiple of the step rate.
    pub offset_us: u16,
    /// Filtered electrodes, counts x 2^5 (Q27.5).
    pub electrodes: Electrodes,
    /// Quantised electrodes on the scalp grid, int8.
    pub plane: Plane,
    /// Number of electrodes whose int8 value was clipped.
    pub clipped: u16,
    /// ADC channels that were at the rail in a sample after the previous step's sample, up to and
    /// including this step's sample; bit n is channel n.
    pub saturated: u64,
    /// True if the filters have not settled yet after the start.
    pub settling: bool,
    /// Electrodes that were excluded, and whose values were filled from the others; bit n is
    /// electrode n. 0 in a step from [`Acquisition`](crate::Acquisition).
    pub excluded: u64,
}

impl Step {
    /// A step of zeros with settled filters.
    pub const SILENCE: Self = Self {
        sample: 0,
        offset_us: 0,
        electrodes: [0; ELECTRODES],
        plane: [0; CELLS],
        clipped: 0,
        saturated: 0,
        settling: false,
        excluded: 0,
    };
}

impl Default for Step {
    fn default() -> Self {
        Self::SILENCE
    }
}

/// One time step of the scalp grid, row-major, int8. One level is
/// `model::INPUT_SCALE_UV` microvolts; a cell without an electrode is 0.
pub type Plane = [i8; CELLS];

/// Quantises filtered electrodes and places them on the scalp grid: `q = round(x * scale)`, rounded
/// half up, saturated to int8. Returns the plane and the number of clipped electrodes.
#[inline]
pub fn quantise(electrodes: &Electrodes) -> (Plane, u16) {
    let mut plane = [0; CELLS];
    let mut clipped = 0;
    for (&x, &cell) in electrodes.iter().zip(&GRID_CELL) {
        let (q, is_clipped) = quantise_electrode(x);
        clipped += u16::from(is_clipped);
        // Every index is on the grid; `get_mut` avoids a panic path.
        if let Some(place) = plane.get_mut(usize::from(cell)) {
            *place = q;
        }
    }
    (plane, clipped)
}

/// Quantises one filtered electrode; also returns whether the value was clipped.
#[inline]
fn quantise_electrode(x: i32) -> (i8, bool) {
    let level = requantise(x, INPUT_MULTIPLIER);
    let q = saturate_i8(level);
    (q, i32::from(q) != level)
}

impl Step {
    /// Replaces an electrode's value, quantises it, and updates the number of clipped electrodes.
    #[inline]
    pub(crate) fn replace(&mut self, electrode: usize, filtered: i32) {
        let place = self.electrodes.get_mut(electrode);
        let cell = GRID_CELL.get(electrode).copied().map(usize::from);
        if let (Some(x), Some(cell)) = (place, cell.and_then(|cell| self.plane.get_mut(cell))) {
            let (_, was_clipped) = quantise_electrode(core::mem::replace(x, filtered));
            let (q, is_clipped) = quantise_electrode(filtered);
            *cell = q;
            self.clipped = self.clipped.saturating_sub(was_clipped.into()) + u16::from(is_clipped);
        }
    }
}

#[cfg(test)]
mod tests {
    use model::{GUARD_BITS, INPUT_SCALE_UV, LSB_NV};

    use super::*;

    #[test]
    fn only_the_two_ends_of_the_range_are_at_the_rail() {
        let rails = [Sample::MAX, -Sample::MAX - 1].map(Sample::at_rail);
        assert_eq!(rails, [1, 1]);
        let inside = [Sample::MAX - 1, -Sample::MAX, 1, 0, -1].map(Sample::at_rail);
        assert_eq!(inside, [0; 5]);
    }

    #[test]
    fn the_mask_has_one_bit_for_each_channel_at_the_rail() {
        for channel in 0..CHANNELS {
            let mut sample = Sample::default();
            assert_eq!(sample.channels_at_rail(), 0);
            sample.counts[channel] = -Sample::MAX - 1;
            assert_eq!(sample.channels_at_rail(), 1 << channel);
        }
    }

    #[test]
    fn a_plane_holds_microvolts_over_the_input_scale() {
        let uv = 100.0;
        #[expect(clippy::cast_possible_truncation, reason = "100 uV are 143,165 in Q27.5")]
        let x = (uv * 1_000.0 / LSB_NV * f32::from(1_u16 << GUARD_BITS)).round() as i32;
        let (plane, clipped) = quantise(&[x; ELECTRODES]);
        let q = f32::from(plane[usize::from(GRID_CELL[0])]);
        assert!((q - uv / INPUT_SCALE_UV).abs() <= 0.51, "{q}");
        assert_eq!(clipped, 0);
        assert_eq!(plane.iter().filter(|&&q| q == 0).count(), CELLS - ELECTRODES);
    }

    #[test]
    fn values_out_of_range_are_clipped_and_counted() {
        let mut electrodes = [0; ELECTRODES];
        electrodes[3] = i32::MAX;
        electrodes[7] = i32::MIN;
        let (plane, clipped) = quantise(&electrodes);
        assert_eq!(clipped, 2);
        assert_eq!(plane[usize::from(GRID_CELL[3])], 127);
        assert_eq!(plane[usize::from(GRID_CELL[7])], -128);
    }
}
