//! Formatting of decimal numbers in messages, without the standard library's float formatting.

use core::fmt;

/// Formats the number `.0` with `.1` decimal places, rounded. Uses integer formatting only, because
/// the standard library's float formatting takes 15 KB of a microcontroller's flash.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Decimal(pub(crate) f32, pub(crate) u32);

impl fmt::Display for Decimal {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        clippy::cast_sign_loss,
        reason = "it saturates; a few digits are shown"
    )]
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(value, places) = *self;
        let unit = 10_u32.pow(places);
        let units = (value.abs() * unit as f32 + 0.5) as u32;
        if value < 0.0 && units > 0 {
            formatter.write_str("-")?;
        }
        write!(formatter, "{}", units / unit)?;
        if places > 0 {
            let width = places as usize;
            write!(formatter, ".{:0width$}", units % unit)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::format;

    use super::*;

    #[test]
    fn a_number_looks_as_the_standard_library_shows_it() {
        for value in [
            0.0, 0.04, 0.05, 0.27, -0.04, -0.06, -1.0, 9.96, 59.94, -312.5, 187_500.0,
        ] {
            assert_eq!(format!("{}", Decimal(value, 3)), format!("{value:.3}"));
        }
        assert_eq!(format!("{}", Decimal(-100.0, 2)), "-100.00");
        assert_eq!(format!("{}", Decimal(299.6, 0)), "300");
        assert_eq!(format!("{}", Decimal(-0.01, 1)), "0.0");
        assert_eq!(format!("{}", Decimal(f32::NAN, 1)), "0.0");
    }
}
