//! Noise of the simulated channels.

/// Pseudo-random Gaussian noise: the sum of twelve uniform numbers from xorshift64*.
#[derive(Clone, Debug)]
pub(super) struct Noise(u64);

impl Noise {
    pub(super) const fn new(seed: u64) -> Self {
        // The generator's state must not be 0.
        Self(seed | 1 << 63)
    }

    /// Returns the next number from a distribution with mean 0 and rms 1.
    pub(super) fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    /// Returns the next uniform number, 0 to 1.
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32;
        let bits = bits as u32;
        f64::from(bits) / f64::from(u32::MAX)
    }
}
