//! Pseudo-random numbers.

/// Pseudo-random numbers in [-1, 1) (a linear congruential generator, Numerical Recipes).
pub(crate) struct Noise(pub(crate) u32);

impl Noise {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(i16::try_from(self.0.cast_signed() >> 16).expect("16 bits")) / 32_768.0
    }

    pub(crate) fn fill(&mut self, length: usize, scale: f32) -> Vec<f32> {
        (0..length).map(|_| self.next() * scale).collect()
    }
}
