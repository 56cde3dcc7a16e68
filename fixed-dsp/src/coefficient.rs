//! A filter coefficient split into an integer and a remainder.

/// A real number as nearest integer plus remainder: value = `integer` + `remainder` / 2^32.
///
/// The integer part is an addition into the high word of a 64-bit accumulator, the remainder one
/// `SMLAL`; the sum's high word is then the result without a shift, and its low word is the exact
/// rounding error. Format Q0.32 for the remainder, |remainder| <= 2^31; coefficient error at most
/// 2^-33 (1.2e-10).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficient {
    /// Nearest integer; |integer| <= 2 in a stable second-order section.
    pub integer: i32,
    /// Rest in Q0.32, in [-0.5, 0.5).
    pub remainder: i32,
}

impl Coefficient {
    /// Exactly 1.
    pub const ONE: Self = Self {
        integer: 1,
        remainder: 0,
    };

    /// The representable number nearest to `value`; |value| < 2^30.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "|value| < 2^30, so |scaled| < 2^62"
    )]
    pub const fn nearest(value: f64) -> Self {
        let scaled = value * 4_294_967_296.0;
        let half = if scaled < 0.0 { -0.5 } else { 0.5 };
        Self::from_q32((scaled + half) as i64)
    }

    /// The number `q32` / 2^32; |q32| < 2^62.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "integer < 2^30 and the remainder is within [-2^31, 2^31) by construction"
    )]
    pub const fn from_q32(q32: i64) -> Self {
        let integer = (q32 + (1 << 31)) >> 32;
        Self {
            integer: integer as i32,
            remainder: (q32 - (integer << 32)) as i32,
        }
    }

    /// The value in Q32: exact.
    pub const fn to_q32(self) -> i64 {
        ((self.integer as i64) << 32) + self.remainder as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coefficient_is_nearest_integer_plus_remainder() {
        for value in [
            -1.996_226, -1.5, -0.5, -0.1, 0.0, 0.25, 0.5, 0.99, 1.5, 1.999_999,
        ] {
            let c = Coefficient::nearest(value);
            #[expect(clippy::cast_precision_loss, reason = "|q32| < 2^34 is exact in f64")]
            let back = c.to_q32() as f64 / 4_294_967_296.0;
            assert!(
                (back - value).abs() <= 0.5 / 4_294_967_296.0,
                "{value} became {back}"
            );
        }
    }
}
