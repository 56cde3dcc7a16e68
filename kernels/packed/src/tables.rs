//! The trained probabilities of the magnitudes.

/// Number of levels on the logarithmic scale of expected magnitudes.
pub const LEVELS: usize = 64;

/// Number of symbols for magnitudes: 0..=14, and 15 for every larger magnitude.
pub const MAGNITUDES: usize = 16;

/// The symbol that stands for magnitude 15 and all larger ones.
pub(crate) const ESCAPE: u16 = 15;

/// Number of bits of a probability: the frequencies of all magnitudes in a table sum to 2^15.
pub const FREQUENCY_BITS: u32 = 15;

/// Cost of 1/16 bit in the trellis, in 1/65536 of a squared step: a whole bit costs as much as a
/// squared error of 0.3 squared steps.
pub(crate) const BIT_COST: i32 = 1229;

/// Start of each magnitude's interval in the range coder (cumulative frequency):
/// `[quantiser][level][magnitude]`.
pub type Starts = [[[u16; MAGNITUDES]; LEVELS]; 2];

/// Length of each magnitude's code in 1/16 bit: `[quantiser][level][magnitude]`.
pub type Costs = [[[u8; MAGNITUDES]; LEVELS]; 2];

/// Probabilities of the magnitudes, and the lengths of their codes.
#[derive(Clone, Copy, Debug)]
pub struct Tables<'t> {
    /// First frequency of each magnitude (cumulative frequency), ascending from 0. A magnitude's
    /// frequencies end where those of the next magnitude begin, or at 2^15. Every magnitude has at
    /// least one frequency.
    pub starts: &'t Starts,
    /// Length of each magnitude's code in 1/16 bit, including the sign, but without the Elias gamma
    /// code of large magnitudes.
    pub costs: &'t Costs,
}

impl Tables<'_> {
    /// Returns true if every magnitude has a frequency, and so can be coded.
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

/// The consecutive frequencies of one symbol in the range coder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Frequencies {
    /// First of the frequencies.
    pub(crate) start: u32,
    /// Number of frequencies, at least 1.
    pub(crate) count: u32,
}

impl Frequencies {
    /// Returns the frequencies of a magnitude, 0..=15, from `starts`, a row of [`Tables::starts`].
    #[inline(always)]
    pub(crate) fn of_magnitude(starts: &[u16; MAGNITUDES], magnitude: usize) -> Self {
        let start = starts[magnitude % MAGNITUDES].into();
        let end = starts.get(magnitude + 1).map_or(1 << FREQUENCY_BITS, |&end| end.into());
        Self { start, count: u32::wrapping_sub(end, start) }
    }
}

const _: () = assert!(ESCAPE as usize + 1 == MAGNITUDES);
