//! Running mean and variance of ADC counts.

/// Running sums for mean and variance. Each count is clipped to within 2^23 of the reference, so the
/// sums over 2^16 counts are exact in 64 bits.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Statistics {
    reference: i32,
    number: u32,
    sum: i64,
    squares: u64,
}

impl Statistics {
    /// Largest number of counts in the sums; further counts are ignored.
    const MOST: u32 = 1 << 16;

    /// Creates empty sums; `reference` should be near the mean.
    pub(crate) const fn around(reference: i32) -> Self {
        Self {
            reference,
            number: 0,
            sum: 0,
            squares: 0,
        }
    }

    /// Adds a count, |count| <= 2^23.
    pub(crate) fn add(&mut self, count: i32) {
        if self.number == Self::MOST {
            return;
        }
        let distance = i64::from(count) - i64::from(self.reference);
        let distance = distance.clamp(-(1 << 23), 1 << 23);
        self.number += 1;
        self.sum += distance;
        self.squares += distance.unsigned_abs().pow(2);
    }

    /// Returns how many counts have been added.
    pub(crate) const fn number(&self) -> u32 {
        self.number
    }

    /// Returns the mean in counts; the reference if no count has been added.
    #[expect(clippy::cast_precision_loss, reason = "|sum| <= 2^39 is exact")]
    pub(crate) fn mean(&self) -> f64 {
        f64::from(self.reference) + self.sum as f64 / f64::from(self.number.max(1))
    }

    /// Returns the sum of squared deviations from the mean, in counts^2.
    #[expect(clippy::cast_precision_loss, reason = "15 digits of a spread suffice")]
    pub(crate) fn spread(&self) -> f64 {
        let sum = self.sum as f64;
        (self.squares as f64 - sum * sum / f64::from(self.number.max(1))).max(0.0)
    }
}

/// Returns `sqrt(spread / number)` in counts, to 1/65536 count. Uses the integer square root, because
/// `core` has no square root for floats.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a variance of at most 2^46 times 2^32 saturates, and is far beyond any limit then"
)]
pub(crate) fn rms(spread: f64, number: u32) -> f64 {
    let variance = spread / f64::from(number.max(1));
    let scale = 65536.0;
    // 2^31 counts^2 is the variance at 1 mV rms and gain 24. Below that, the scaled variance fits into
    // 64 bits.
    if variance < 2_147_483_648.0 {
        ((variance * scale * scale) as u64).isqrt() as f64 / scale
    } else {
        (variance as u64).isqrt() as f64
    }
}
