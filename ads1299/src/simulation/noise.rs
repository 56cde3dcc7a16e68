//! Noise from a seed.

/// Gaussian noise from a seed: xorshift64*, and the sum of twelve uniform numbers.
#[derive(Clone, Debug)]
pub(super) struct Noise(u64);

impl Noise {
    pub(super) const fn new(seed: u64) -> Self {
        // 0 would stay 0.
        Self(seed | 1 << 63)
    }

    /// Mean 0, rms 1.
    pub(super) fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    /// 0 to 1.
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32;
        let bits = bits as u32;
        f64::from(bits) / f64::from(u32::MAX)
    }
}
