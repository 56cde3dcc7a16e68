//! What the ADC delivers at one moment.

use model::CHANNELS;

/// One time step of all ADC channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Counts, 24-bit two's complement in 32, |count| <= 2^23; the index is the ADC channel.
    pub counts: [i32; CHANNELS],
}

impl Sample {
    /// Largest count of a 24-bit converter; the smallest is `-MAX - 1`. A channel that delivers
    /// either is at the rail.
    pub const MAX: i32 = (1 << 23) - 1;

    /// 1 for a count at the rail, else 0.
    #[inline]
    pub(crate) const fn rail(count: i32) -> u32 {
        // -MAX - 1 is the complement of MAX: what is left of both is MAX, the only number that
        // reaches 2^23 with one more.
        ((count ^ (count >> 31)) + 1).cast_unsigned() >> 23
    }

    /// The channels that stand at the rail, one bit each.
    #[inline]
    pub fn rails(&self) -> u64 {
        const { assert!(CHANNELS <= 64, "one bit for each channel") };
        // In halves, because a shift of 64 bits costs a Cortex-M six instructions.
        let (low, high) = self
            .counts
            .split_at(if CHANNELS < 32 { CHANNELS } else { 32 });
        let [low, high] = [low, high].map(|counts| {
            let bits = counts.iter().rev().map(|&count| Self::rail(count));
            bits.fold(0, |rails, bit| rails << 1 | bit)
        });
        u64::from(high) << 32 | u64::from(low)
    }
}

impl Default for Sample {
    /// Silence.
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
    fn only_the_two_ends_of_the_range_are_rails() {
        let rails = [Sample::MAX, -Sample::MAX - 1].map(Sample::rail);
        assert_eq!(rails, [1, 1]);
        let inside = [Sample::MAX - 1, -Sample::MAX, 1, 0, -1].map(Sample::rail);
        assert_eq!(inside, [0; 5]);
    }

    #[test]
    fn each_channel_at_the_rail_has_its_bit() {
        for channel in 0..CHANNELS {
            let mut sample = Sample::default();
            assert_eq!(sample.rails(), 0);
            sample.counts[channel] = -Sample::MAX - 1;
            assert_eq!(sample.rails(), 1 << channel);
        }
    }
}
