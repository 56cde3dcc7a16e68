//! A filter coefficient, stored as an integer plus a fraction.

/// A real number as nearest integer plus signed fraction: value = `integer` + `fraction` / 2^32.
///
/// The product of a sample and the integer is added to the high word of a 64-bit accumulator; the
/// product of the sample and the fraction takes one `SMLAL`. The high word of the sum is then the
/// result, without a shift, and the low word the exact rounding error. The coefficient itself is
/// rounded by at most 2^-33 (1.2e-10).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficient {
    /// Integer nearest to the value; |integer| <= 2 in a stable second-order section.
    pub integer: i32,
    /// Value minus `integer`, Q0.32, in [-0.5, 0.5).
    pub fraction: i32,
}

impl Coefficient {
    /// Returns the coefficient nearest to `value`; |value| must be below 2^30.
    #[expect(clippy::cast_possible_truncation, reason = "|value| < 2^30, so |scaled| < 2^62")]
    pub const fn nearest(value: f64) -> Self {
        let scaled = value * 4_294_967_296.0;
        let half = if scaled < 0.0 { -0.5 } else { 0.5 };
        Self::from_q32((scaled + half) as i64)
    }

    /// Returns the coefficient `q32` / 2^32; |q32| must be below 2^62.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "|integer| < 2^30 and the fraction is within [-2^31, 2^31) by construction"
    )]
    pub const fn from_q32(q32: i64) -> Self {
        let integer = (q32 + (1 << 31)) >> 32;
        Self { integer: integer as i32, fraction: (q32 - (integer << 32)) as i32 }
    }

    /// Returns the exact value of the coefficient in Q32.
    pub const fn to_q32(self) -> i64 {
        ((self.integer as i64) << 32) + self.fraction as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coefficient_is_its_value_to_half_a_unit_of_q32() {
        for value in [-1.996_226, -1.5, -0.5, -0.1, 0.0, 0.25, 0.5, 0.99, 1.5, 1.999_999] {
            let c = Coefficient::nearest(value);
            #[expect(clippy::cast_precision_loss, reason = "|q32| < 2^34 is exact in f64")]
            let back = c.to_q32() as f64 / 4_294_967_296.0;
            assert!((back - value).abs() <= 0.5 / 4_294_967_296.0, "{value} became {back}");
        }
    }
}
