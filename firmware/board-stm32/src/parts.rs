//! A board's pins and peripherals, as data and as types.

use core::fmt;

/// A pin of the microcontroller; as [`Display`](fmt::Display) its row in `docs/hardware.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// What it carries.
    pub signal: &'static str,
    /// Its name in the data sheet.
    pub name: &'static str,
    /// Where it goes.
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

/// Whether the rows below `heading` of a Markdown text are these pins, in their order.
pub fn are_documented(pins: &[Pin], text: &str, heading: &str) -> bool {
    let Some((_, section)) = text.split_once(heading) else {
        return false;
    };
    let section = section.split("\n#").next().unwrap_or(section);
    // Behind the header and the line under it.
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

/// What a board uses of its microcontroller: `PINS`, which the documentation is held against, and on the
/// microcontroller `Parts`, which holds the same pins and other peripherals by their use.
#[macro_export]
macro_rules! parts {
    (
        pins { $($pin:ident: $name:ident, $signal:literal, $to:literal;)* }
        peripherals { $($part:ident: $peripheral:ident;)* }
    ) => {
        /// Every pin that is used.
        #[cfg(any(test, not(target_os = "none")))]
        pub(crate) const PINS: &[$crate::Pin] = &[$($crate::Pin {
            signal: $signal,
            name: stringify!($name),
            to: $to,
        }),*];

        /// What the board uses.
        #[cfg(target_os = "none")]
        pub(crate) struct Parts {
            $(pub(crate) $pin: embassy_stm32::Peri<'static, embassy_stm32::peripherals::$name>,)*
            $(pub(crate) $part: embassy_stm32::Peri<'static, embassy_stm32::peripherals::$peripheral>,)*
        }

        #[cfg(target_os = "none")]
        impl Parts {
            /// Takes them from all there are.
            pub(crate) fn of(all: embassy_stm32::Peripherals) -> Self {
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
    fn a_table_with_another_pin_a_missing_one_or_one_too_many_is_refused() {
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
