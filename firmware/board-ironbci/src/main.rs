//! The application on an ironbci: STM32F407VE, Cortex-M4F at 168 MHz, one ADS1299.
//!
//! **The image has not run on hardware yet.** On a PC the program prints the board's pins as rows
//! for `docs/hardware.md`.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![forbid(unsafe_code)]

mod parts;

#[cfg(target_os = "none")]
mod application;
#[cfg(target_os = "none")]
mod uart;

board_stm32::pin_rows!("### ironbci");
