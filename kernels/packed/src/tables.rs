//! The trained probabilities of the magnitudes.

/// Number of levels of an expected magnitude.
pub const LEVELS: usize = 64;

/// Number of symbols for magnitudes: 0..=14, and 15 for every larger magnitude.
pub const MAGNITUDES: usize = 16;

/// The magnitude that stands for itself and all larger ones.
pub(crate) const ESCAPE: u16 = 15;

/// Bits of a probability: all frequencies of a table sum to 2^15.
pub const FREQUENCY_BITS: u32 = 15;

/// Cost of 1/16 bit in the trellis, in 1/65536 of the squared step. A whole bit costs 0.3 squared
/// steps.
pub(crate) const BIT_COST: i32 = 1229;

/// First frequency of each magnitude, for each level, for each of the two quantisers.
pub type Starts = [[[u16; MAGNITUDES]; LEVELS]; 2];

/// Bits of each magnitude, 1/16 bit, for each level, for each of the two quantisers.
pub type Costs = [[[u8; MAGNITUDES]; LEVELS]; 2];

/// Probabilities of the magnitudes, and what their bits cost in the trellis.
#[derive(Clone, Copy, Debug)]
pub struct Tables<'t> {
    /// First of the frequencies of each magnitude, ascending from 0; a magnitude's frequencies end
    /// where those of the next begin, those of the last at 2^15. No magnitude is without a
    /// frequency.
    pub starts: &'t Starts,
    /// Bits of each magnitude, 1/16 bit: its sign included, the Elias gamma code of large
    /// magnitudes excluded.
    pub costs: &'t Costs,
}

impl Tables<'_> {
    /// Returns true if every magnitude has a frequency, so that every magnitude can be written and
    /// read.
    pub const fn is_consistent(&self) -> bool {
        let mut row = 0;
        while row < 2 * LEVELS {
            let starts = &self.starts[row / LEVELS][row % LEVELS];
            if starts[0] != 0 || starts[MAGNITUDES - 1] >= 1 << FREQUENCY_BITS {
                return false;
            }
            let mut magnitude = 1;
            while magnitude < MAGNITUDES {
                if starts[magnitude] <= starts[magnitude - 1] {
                    return false;
                }
                magnitude += 1;
            }
            row += 1;
        }
        true
    }
}

/// The frequencies of one symbol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Frequencies {
    /// First frequency.
    pub(crate) start: u32,
    /// Number of frequencies, at least 1.
    pub(crate) count: u32,
}

impl Frequencies {
    /// Returns the frequencies of a magnitude, at most 15, in a row of [`Tables::starts`].
    #[inline(always)]
    pub(crate) fn of_magnitude(starts: &[u16; MAGNITUDES], magnitude: usize) -> Self {
        let start = starts[magnitude % MAGNITUDES].into();
        let end = starts
            .get(magnitude + 1)
            .map_or(1 << FREQUENCY_BITS, |&end| end.into());
        Self {
            start,
            count: u32::wrapping_sub(end, start),
        }
    }
}

const _: () = assert!(ESCAPE as usize + 1 == MAGNITUDES);
