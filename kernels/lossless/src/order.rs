//! The order of the differences that a channel's codes contain.

/// Number of successive differences between a count and its code: 0 is the count itself, 1 its
/// difference from the previous count, 2 the difference of those, 3 once more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Order {
    Zero,
    #[default]
    One,
    Two,
    Three,
}

impl Order {
    /// Orders in the order of their numbers.
    pub(crate) const ALL: [Self; 4] = [Self::Zero, Self::One, Self::Two, Self::Three];

    /// Returns the order with the number in the two lowest bits of `bits`.
    pub(crate) fn from_bits(bits: u32) -> Self {
        match bits & 3 {
            0 => Self::Zero,
            1 => Self::One,
            2 => Self::Two,
            _ => Self::Three,
        }
    }

    /// Returns the number of the order, 0 to 3.
    pub(crate) const fn bits(self) -> u32 {
        self as u32
    }
}
