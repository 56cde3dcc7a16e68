//! Generator of pseudo-random numbers that are the same on PC and microcontroller.

/// State of a linear congruential generator with Knuth's 64-bit constants (MMIX; The Art of
/// Computer Programming 2, 3.3.4).
#[derive(Clone, Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Returns the next number, uniform over 32 bits.
    pub(crate) fn next(&mut self) -> u32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // Use the upper half: the lowest bits of this generator have short periods.
        (self.0 >> 32) as u32
    }
}
