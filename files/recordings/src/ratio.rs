//! Exact fractions for sampling rates and durations.

use std::fmt;

/// A positive fraction in lowest terms: a rate in Hz or a duration in s.
///
/// A file states the number of samples in a record, and the duration of a record as a decimal or as
/// two integers. Exact fractions keep the virtual ADC free of time drift: sample k is at the time
/// `k / rate`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ratio {
    numerator: u64,
    denominator: u64,
}

impl Ratio {
    /// Creates the fraction `numerator / denominator` in lowest terms; `None` if either is 0.
    pub fn new(numerator: u64, denominator: u64) -> Option<Self> {
        if numerator == 0 || denominator == 0 {
            return None;
        }
        let divisor = greatest_common_divisor(numerator, denominator);
        Some(Self { numerator: numerator / divisor, denominator: denominator / divisor })
    }

    /// Returns the simplest fraction within a relative error of 1e-11 of `value`, such as 1/256 for
    /// 0.00390625; `None` for values outside (1e-9, 1e9).
    pub fn from_f64(value: f64) -> Option<Self> {
        if !value.is_finite() || value <= 1e-9 || value >= 1e9 {
            return None;
        }
        Self::simplest(value * (1.0 - 1e-11), value * (1.0 + 1e-11))
    }

    /// Among the fractions from `least` to `most`, returns the one with the smallest terms, found
    /// by continued fractions; `None` unless 0 < `least` <= `most` and the terms fit 64 bits.
    pub(crate) fn simplest(least: f64, most: f64) -> Option<Self> {
        let (mut low, mut high) = (least, most);
        if low.is_nan() || high.is_nan() || low <= 0.0 || low > high {
            return None;
        }
        let (mut before, mut now) = ((0_u64, 1_u64), (1_u64, 0_u64));
        // Each pass adds a term of the continued fraction. The numerator and the denominator at
        // least double in two passes, so 128 passes exceed 64 bits.
        for _ in 0..128 {
            let has_integer = low.ceil() <= high;
            let term = if has_integer { low.ceil() } else { low.floor() };
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "not negative; what saturates overflows the product, or is refused"
            )]
            let whole = term as u64;
            let numerator = whole.checked_mul(now.0)?.checked_add(before.0)?;
            let denominator = whole.checked_mul(now.1)?.checked_add(before.1)?;
            if has_integer {
                return Self::new(numerator, denominator);
            }
            (before, now) = (now, (numerator, denominator));
            (low, high) = (1.0 / (high - term), 1.0 / (low - term));
        }
        None
    }

    /// Returns the numerator in lowest terms, > 0.
    pub fn numerator(self) -> u64 {
        self.numerator
    }

    /// Returns the denominator in lowest terms, > 0.
    pub fn denominator(self) -> u64 {
        self.denominator
    }

    /// Returns the fraction as the nearest f64.
    pub fn value(self) -> f64 {
        quotient(self.numerator, self.denominator)
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.value())
    }
}

#[expect(clippy::cast_precision_loss, reason = "rates and durations stay far below 2^53")]
pub(crate) fn quotient(a: u64, b: u64) -> f64 {
    a as f64 / b as f64
}

/// Computes the greatest common divisor by Euclid's algorithm; both arguments must be > 0.
fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    let (mut a, mut b) = (a, b);
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_become_their_simplest_fraction() {
        for (value, numerator, denominator) in [
            (1.0, 1, 1),
            (0.1, 1, 10),
            (0.003_906_25, 1, 256),
            (1.0 / 300.0, 1, 300),
            (2.5, 5, 2),
            (99_999_999.5, 199_999_999, 2),
        ] {
            let ratio = Ratio::from_f64(value).expect("in range");
            assert_eq!((ratio.numerator(), ratio.denominator()), (numerator, denominator));
        }
    }

    #[test]
    fn no_fraction_of_an_interval_has_smaller_terms() {
        for (least, most, numerator, denominator) in [
            (0.001_953_05, 0.001_953_15, 1, 512),
            (0.333_332_5, 0.333_333_5, 1, 3),
            (0.999_937_6, 0.999_938_4, 16_025, 16_026),
            (2.9, 3.1, 3, 1),
            (3.0, 3.0, 3, 1),
        ] {
            let found = Ratio::simplest(least, most);
            assert_eq!(found, Ratio::new(numerator, denominator), "{least}");
        }
        for (least, most) in [(0.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (1.0, f64::NAN)] {
            assert_eq!(Ratio::simplest(least, most), None, "{least} {most}");
        }
    }

    #[test]
    fn zero_negative_and_extreme_numbers_are_refused() {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-12, 1e12] {
            assert_eq!(Ratio::from_f64(value), None, "{value}");
        }
        assert_eq!(Ratio::new(1, 0), None);
        assert_eq!(Ratio::new(0, 1), None);
    }
}
