//! Test signals: easy to compress, hard to compress, or at the limits of the range.

use proptest::prelude::*;

/// Number of channels of every test signal.
pub(super) const CHANNELS: usize = 5;

/// One sample: the counts of all channels.
pub(super) type Row = [i32; CHANNELS];

/// Largest count that 24 bits can hold.
const MAX: i32 = (1 << 23) - 1;

/// Shape of a test signal; the number in a variant is the width of its noise in bits.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// Uniform noise with this number of bits, different in each sample.
    Noise(u32),
    /// Running sum of noise with this number of bits, limited to the rails.
    Walk(u32),
    /// Running sum of a running sum of noise with this number of bits.
    SmoothWalk(u32),
    /// Every count is at one rail or the other.
    Rails,
    /// Constant for 16 samples on average, then a jump to any count.
    Steps,
}

impl Shape {
    /// Examples of all shapes, with several sizes of noise.
    pub(super) const SOME: [Self; 8] = [
        Self::Noise(0),
        Self::Noise(3),
        Self::Noise(22),
        Self::Noise(24),
        Self::Walk(8),
        Self::SmoothWalk(5),
        Self::Rails,
        Self::Steps,
    ];

    /// Returns `samples` samples of this shape; the same `seed` yields the same samples.
    pub(super) fn rows(self, seed: u64, samples: usize) -> Vec<Row> {
        let mut random = seed;
        let mut value = [0_i64; CHANNELS];
        let mut slope = [0_i64; CHANNELS];
        let row = |_| {
            std::array::from_fn(|channel| {
                let (value, slope) = (&mut value[channel], &mut slope[channel]);
                let next = split_mix(&mut random);
                let noise = |bits: u32| match bits {
                    0 => 0,
                    bits => next.cast_signed() >> (64 - bits),
                };
                match self {
                    Self::Noise(bits) => *value = noise(bits),
                    Self::Walk(bits) => *value += noise(bits),
                    Self::SmoothWalk(bits) => {
                        *slope += noise(bits) - *slope / 64;
                        *value += *slope;
                    }
                    Self::Rails => *value = (noise(1) * 2 + 1) << 40,
                    Self::Steps if next.is_multiple_of(16) => *value = noise(24),
                    Self::Steps => {}
                }
                let limit = i64::from(MAX);
                i32::try_from((*value).clamp(-limit - 1, limit)).expect("clamped")
            })
        };
        (0..samples).map(row).collect()
    }
}

/// Draws signals of all shapes; each channel has different noise.
pub(super) fn rows(samples: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Row>> {
    let shape = prop_oneof![
        (0..=24_u32).prop_map(Shape::Noise),
        (0..=24_u32).prop_map(Shape::Walk),
        (0..=20_u32).prop_map(Shape::SmoothWalk),
        Just(Shape::Rails),
        Just(Shape::Steps),
    ];
    (shape, any::<u64>(), samples).prop_map(|(shape, seed, samples)| shape.rows(seed, samples))
}

/// Returns a count as the encoder takes it: 24-bit two's complement, least significant byte first.
pub(super) fn to_bytes(count: i32) -> [u8; 3] {
    let [low, middle, high, _] = count.to_le_bytes();
    [low, middle, high]
}

/// Returns the next number of the generator SplitMix64 (Steele, Lea and Flood 2014).
fn split_mix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut mixed = *state;
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}
