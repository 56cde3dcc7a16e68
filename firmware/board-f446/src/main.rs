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

board_stm32::pin_rows!("### NUCLEO-F446RE");
