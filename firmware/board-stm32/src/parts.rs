//! Pins and peripherals of a board, as rows of its documentation and as types of the HAL.

use core::fmt;

/// Pin of the microcontroller. [`Display`](fmt::Display) writes the pin's row in
/// `docs/hardware.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Signal that the pin carries.
    pub signal: &'static str,
    /// Name in the data sheet, such as `PA5`.
    pub name: &'static str,
    /// Part or connector at the other end of the wire.
    pub to: &'static str,
}

impl fmt::Display for Pin {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "| {} | {} | {} |",
            self.signal, self.name, self.to
        )
    }
}

/// Returns whether the first table after `heading` in a Markdown text lists exactly `pins`, in
/// their order.
pub fn are_documented(pins: &[Pin], text: &str, heading: &str) -> bool {
    let Some((_, section)) = text.split_once(heading) else {
        return false;
    };
    let section = section.split("\n#").next().unwrap_or(section);
    // Skip the header row and the line below it.
    let mut rows = section.lines().filter(|line| line.starts_with('|')).skip(2);
    pins.iter()
        .all(|pin| rows.next().is_some_and(|row| is_row(*pin, row)))
        && rows.next().is_none()
}

fn is_row(pin: Pin, row: &str) -> bool {
    let mut cells = row.trim_matches('|').split('|').map(str::trim);
    [pin.signal, pin.name, pin.to]
        .into_iter()
        .all(|cell| cells.next() == Some(cell))
        && cells.next().is_none()
}

/// Declares the pins and peripherals of a board: `PINS`, which a test compares with the
/// documentation, and on the microcontroller `Parts`, a struct that owns the same pins and the
/// peripherals.
#[macro_export]
macro_rules! parts {
    (
        pins { $($pin:ident: $name:ident, $signal:literal, $to:literal;)* }
        peripherals { $($part:ident: $peripheral:ident;)* }
    ) => {
        /// Pins of the board, in the order of its documentation.
        #[cfg(any(test, not(target_os = "none")))]
        pub(crate) const PINS: &[$crate::parts::Pin] = &[$($crate::parts::Pin {
            signal: $signal,
            name: stringify!($name),
            to: $to,
        }),*];

        /// Pins and peripherals of the board, named after their use.
        #[cfg(target_os = "none")]
        pub(crate) struct Parts {
            $(pub(crate) $pin: embassy_stm32::Peri<'static, embassy_stm32::peripherals::$name>,)*
            $(pub(crate) $part: embassy_stm32::Peri<'static, embassy_stm32::peripherals::$peripheral>,)*
        }

        #[cfg(target_os = "none")]
        impl Parts {
            /// Moves the board's parts out of `all`.
            pub(crate) fn new(all: embassy_stm32::Peripherals) -> Self {
                Self {
                    $($pin: all.$name,)*
                    $($part: all.$peripheral,)*
                }
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIN: Pin = Pin {
        signal: "SCLK",
        name: "PA5",
        to: "all chips",
    };

    #[test]
    fn a_table_with_a_different_a_missing_or_an_extra_pin_is_rejected() {
        let text =
            |rows: &str| std::format!("# A board\n\n| a | b | c |\n| - | - | - |\n{rows}\n# B");
        let row = std::format!("{PIN}\n");
        assert!(are_documented(&[PIN], &text(&row), "# A board"));
        assert!(!are_documented(
            &[PIN],
            &text(&row.replace("PA5", "PA6")),
            "# A board"
        ));
        assert!(!are_documented(&[PIN], &text(""), "# A board"));
        assert!(!are_documented(&[PIN], &text(&row.repeat(2)), "# A board"));
        assert!(!are_documented(&[PIN], "", "# A board"));
    }
}
