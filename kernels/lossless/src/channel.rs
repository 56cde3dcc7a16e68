//! What encoder and decoder both derive from the earlier counts of a channel.

use crate::rice;

/// State of one channel: its newest count and differences, and the mean size of coded differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) past: Past,
    /// Running mean of the folded differences over about 16 samples, times 16 (UQ28.4); below 2^32.
    mean: u32,
    pub(crate) order: Order,
}

/// The newest count of a channel, and its first and second differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Past {
    /// Newest count, |x| <= 2^23.
    pub(crate) x: i32,
    /// Newest count minus the count before it, |d1| <= 2^24.
    d1: i32,
    /// Newest difference `d1` minus the difference before it, |d2| <= 2^25.
    d2: i32,
}

impl Channel {
    /// State of a channel before its first block. All fields are zero, so that a static with this
    /// value takes no flash. The first block, a key block, sets the order.
    pub(crate) const NEW: Self =
        Self { past: Past { x: 0, d1: 0, d2: 0 }, mean: 0, order: Order::Zero };

    /// Returns the Rice parameter k of the next block: log2 of the mean, rounded down.
    #[inline]
    pub(crate) fn k(&self) -> u32 {
        ((self.mean >> 4) | 1).ilog2().min(rice::MAX_K)
    }

    /// Starts a key block with its first count, its order of differences and its Rice parameter k.
    pub(crate) fn start_key(&mut self, first: i32, order: Order, k: u32) {
        self.past = Past::after(first);
        self.order = order;
        // 1.5 * 2^k is a typical mean of values for which k is optimal; `mean` holds 16 times the
        // mean.
        self.mean = 24 << k;
    }

    /// Updates the mean with a block of `codes` folded differences, at most 8, whose sum is `sum`,
    /// at most 2^30.
    #[inline]
    pub(crate) fn observe(&mut self, sum: u32, codes: u32) {
        // `mean` stays below 2^32: a block of c codes adds at most c * 2^27, so that `mean`
        // approaches at most 16 * 2^27.
        self.mean = self.mean.wrapping_sub((self.mean >> 4).wrapping_mul(codes));
        self.mean = self.mean.saturating_add(sum);
    }
}

impl Past {
    /// Returns the past of a channel whose counts have all been `x`.
    pub(crate) const fn after(x: i32) -> Self {
        Self { x, d1: 0, d2: 0 }
    }

    /// Appends a count and returns its differences of orders 0 to 3, |d3| < 2^26.
    #[inline]
    pub(crate) fn append(&mut self, x: i32) -> [i32; 4] {
        let d1 = x.wrapping_sub(self.x);
        let d2 = d1.wrapping_sub(self.d1);
        let d3 = d2.wrapping_sub(self.d2);
        *self = Self { x, d1, d2 };
        [x, d1, d2, d3]
    }

    /// Returns the prediction of the next count: the count with which the next difference of this
    /// order would be 0. Wraps.
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

/// The number of times that differences are taken before a count is coded: order 0 codes the count
/// itself, 1 its difference from the previous count, 2 the difference of two order-1 differences,
/// and 3 the difference of two order-2 differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    Zero,
    One,
    Two,
    Three,
}

impl Order {
    /// All orders, each at the index that equals its number.
    pub(crate) const ALL: [Self; 4] = [Self::Zero, Self::One, Self::Two, Self::Three];

    /// Returns the order whose number is in the two lowest bits of `bits`.
    pub(crate) fn from_bits(bits: u32) -> Self {
        match bits & 3 {
            0 => Self::Zero,
            1 => Self::One,
            2 => Self::Two,
            _ => Self::Three,
        }
    }

    /// Returns the number of the order, 0 to 3, which a block states in two bits.
    pub(crate) const fn bits(self) -> u32 {
        self as u32
    }
}
