//! The application on a NUCLEO-F446RE: STM32F446RE, Cortex-M4F at 168 MHz.
//!
//! **The image has not run on hardware yet.** On a PC the program prints the board's pins as rows
//! for `docs/hardware.md`.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![forbid(unsafe_code)]

mod parts;

#[cfg(target_os = "none")]
mod application;
#[cfg(all(target_os = "none", feature = "uart"))]
mod uart;

#[cfg(not(target_os = "none"))]
fn main() {
    for pin in parts::PINS {
        println!("{pin}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_documentation_lists_the_pins_of_the_code() {
        let text = include_str!("../../../docs/hardware.md");
        assert!(
            board_stm32::parts::are_documented(parts::PINS, text, "### NUCLEO-F446RE"),
            "`cargo run --package board-f446` prints the rows for docs/hardware.md"
        );
    }
}
