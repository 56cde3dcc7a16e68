//! One sample of the ADC.

use model::CHANNELS;

/// The counts of all ADC channels at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Counts by ADC channel: 24-bit two's complement in 32 bits, |count| <= 2^23.
    pub counts: [i32; CHANNELS],
}

impl Sample {
    /// Largest count of a 24-bit converter; the smallest is `-MAX - 1`. A channel with either count is at
    /// the rail.
    pub const MAX: i32 = (1 << 23) - 1;

    /// Returns 1 for a count at the rail, otherwise 0.
    #[inline]
    pub(crate) const fn at_rail(count: i32) -> u32 {
        // The XOR complements negative counts. Both rails become MAX, all other counts smaller numbers;
        // only MAX + 1 has bit 23 set.
        ((count ^ (count >> 31)) + 1).cast_unsigned() >> 23
    }

    /// Returns the channels that are at the rail; bit n is channel n.
    #[inline]
    pub fn channels_at_rail(&self) -> u64 {
        const { assert!(CHANNELS <= 64, "the mask has 64 bits") };
        // Two halves of 32 bits, because a Cortex-M needs several instructions to shift 64 bits.
        let (low, high) = self
            .counts
            .split_at(if CHANNELS < 32 { CHANNELS } else { 32 });
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
        Self {
            counts: [0; CHANNELS],
        }
    }
}

#[cfg(test)]
mod tests {
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
}
