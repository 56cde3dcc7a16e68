//! The past of one channel, the same in encoder and decoder.

use crate::rice;

/// The newest count of a channel with its differences, and the mean length of its codes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) past: Past,
    /// Running mean of the folded differences over about 16 samples: value x 16, UQ28.4, < 2^32.
    mean: u32,
    pub(crate) order: Order,
}

/// The newest count of a channel and its first and second difference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Past {
    /// Newest count, |x| <= 2^23.
    pub(crate) x: i32,
    /// Its difference from the count before it, |d1| <= 2^24.
    d1: i32,
    /// Difference of the newest two differences, |d2| <= 2^25.
    d2: i32,
}

impl Channel {
    /// Channel before the first block of a run.
    pub(crate) const NEW: Self = Self {
        past: Past { x: 0, d1: 0, d2: 0 },
        mean: 0,
        order: Order::One,
    };

    /// Returns the parameter k of the next block's codes: the logarithm of the mean, rounded down.
    #[inline]
    pub(crate) fn k(&self) -> u32 {
        ((self.mean >> 4) | 1).ilog2().min(rice::MAX_K)
    }

    /// Starts a key block, whose codes have the parameter k.
    pub(crate) fn start_key(&mut self, first: i32, order: Order, k: u32) {
        self.past = Past::after(first);
        self.order = order;
        // 1.5 * 2^k is a typical mean of values for which k is right.
        self.mean = 24 << k;
    }

    /// Adds the sum of a block's `codes` folded differences to the mean; `codes` is at most 8, the
    /// sum at most 2^30.
    #[inline]
    pub(crate) fn observe(&mut self, sum: u32, codes: u32) {
        // The mean stays below 2^32: it is at most 2 * 2^30 after 8 codes, and below 16 * 2^27
        // always.
        self.mean = self.mean.wrapping_sub((self.mean >> 4).wrapping_mul(codes));
        self.mean = self.mean.saturating_add(sum);
    }
}

impl Past {
    /// Returns the past of a channel whose counts have all been `x`.
    pub(crate) const fn after(x: i32) -> Self {
        Self { x, d1: 0, d2: 0 }
    }

    /// Appends a count and returns its differences of order 0 to 3, |d3| < 2^26.
    #[inline]
    pub(crate) fn append(&mut self, x: i32) -> [i32; 4] {
        let d1 = x.wrapping_sub(self.x);
        let d2 = d1.wrapping_sub(self.d1);
        let d3 = d2.wrapping_sub(self.d2);
        *self = Self { x, d1, d2 };
        [x, d1, d2, d3]
    }

    /// Returns the count whose difference of this order is `difference`; wraps.
    pub(crate) fn predicted(&self, order: Order) -> i32 {
        let Self { x, d1, d2 } = *self;
        match order {
            Order::Zero => 0,
            Order::One => x,
            Order::Two => x.wrapping_add(d1),
            Order::Three => x.wrapping_add(d1).wrapping_add(d2),
        }
    }
}

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
