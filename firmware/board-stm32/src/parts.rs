//! Macros that declare the pins and peripherals of a board, as rows of its documentation and as
//! types of the HAL, and that create what every board has: SPI bus, wires of the converters, UART
//! port.

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
        write!(formatter, "| {} | {} | {} |", self.signal, self.name, self.to)
    }
}

/// Returns whether the first table after `heading` in a Markdown text lists exactly `pins`, in
/// order.
pub fn are_documented(pins: &[Pin], text: &str, heading: &str) -> bool {
    let Some((_, section)) = text.split_once(heading) else {
        return false;
    };
    let section = section.split("\n#").next().unwrap_or(section);
    // Skip the header row and the line below it.
    let mut rows = section.lines().filter(|line| line.starts_with('|')).skip(2);
    pins.iter().all(|pin| rows.next().is_some_and(|row| is_row(*pin, row))) && rows.next().is_none()
}

fn is_row(pin: Pin, row: &str) -> bool {
    let mut cells = row.trim_matches('|').split('|').map(str::trim);
    [pin.signal, pin.name, pin.to].into_iter().all(|cell| cells.next() == Some(cell))
        && cells.next().is_none()
}

/// Declares a board's pins and peripherals: `PINS`, which a test compares with the documentation,
/// and on the microcontroller the struct `Parts`, which owns these pins and the peripherals.
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

/// Defines a board's program on a PC: `main` prints the pins as rows for `docs/hardware.md`, and a
/// test compares them with the section `$heading` of that page.
#[macro_export]
macro_rules! pin_rows {
    ($heading:literal) => {
        #[cfg(not(target_os = "none"))]
        fn main() {
            for pin in parts::PINS {
                println!("{pin}");
            }
        }

        #[cfg(test)]
        #[test]
        fn the_documentation_lists_the_pins_of_the_code() {
            let text = include_str!("../../../docs/hardware.md");
            assert!(
                $crate::parts::are_documented(parts::PINS, text, $heading),
                "`cargo run --package {}` prints the rows for docs/hardware.md",
                env!("CARGO_PKG_NAME")
            );
        }
    };
}

/// Returns the converters' SPI bus from a board's `Parts`. `$irqs` are the interrupts of its DMA;
/// the DMA must be able to access `$buffer`.
#[macro_export]
macro_rules! bus {
    ($parts:ident, $irqs:expr, $buffer:expr) => {{
        let config = $crate::Bus::config();
        let spi = embassy_stm32::spi::Spi::new(
            $parts.spi,
            $parts.sclk,
            $parts.mosi,
            $parts.miso,
            $parts.spi_tx,
            $parts.spi_rx,
            $irqs,
            config,
        );
        $crate::Bus::new(spi, $buffer)
    }};
}

/// Returns the wires of a chain of up to eight converters from a board's `Parts` and the bus.
#[macro_export]
macro_rules! chain_wires {
    ($parts:ident, $bus:expr) => {
        $crate::Wires::new(
            $bus,
            [
                $parts.select0.into(),
                $parts.select1.into(),
                $parts.select2.into(),
                $parts.select3.into(),
                $parts.select4.into(),
                $parts.select5.into(),
                $parts.select6.into(),
                $parts.select7.into(),
            ],
            [$parts.start.into(), $parts.reset.into()],
            $parts.drdy,
            $parts.drdy_line,
        )
    };
}

/// Returns the port over the UART `$uart` from a board's `Parts`. `$irqs` are its interrupts; the
/// DMA must be able to access `$memory`.
#[macro_export]
macro_rules! uart_port {
    ($parts:ident, $uart:ty, $irqs:expr, $memory:expr) => {{
        let (uart, tx, to_host) = ($parts.uart, $parts.uart_tx, $parts.uart_to_host);
        let config = $crate::Port::config();
        let transmitter = embassy_stm32::usart::UartTx::new(uart, tx, to_host, $irqs, config);
        $crate::Port::new::<$uart, _>(
            transmitter.expect("921600 baud"),
            $parts.uart_rx,
            $parts.uart_from_host,
            $irqs,
            $memory,
        )
    }};
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIN: Pin = Pin { signal: "SCLK", name: "PA5", to: "all chips" };

    #[test]
    fn a_table_with_a_different_a_missing_or_an_extra_pin_is_rejected() {
        let text =
            |rows: &str| std::format!("# A board\n\n| a | b | c |\n| - | - | - |\n{rows}\n# B");
        let row = std::format!("{PIN}\n");
        assert!(are_documented(&[PIN], &text(&row), "# A board"));
        assert!(!are_documented(&[PIN], &text(&row.replace("PA5", "PA6")), "# A board"));
        assert!(!are_documented(&[PIN], &text(""), "# A board"));
        assert!(!are_documented(&[PIN], &text(&row.repeat(2)), "# A board"));
        assert!(!are_documented(&[PIN], "", "# A board"));
    }
}
