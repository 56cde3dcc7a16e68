//! The application on a NUCLEO-H743ZI2: STM32H743ZI, Cortex-M7 at 480 MHz.
//!
//! **The image has not run on hardware yet.** On a PC the program prints the board's pins as rows
//! for `docs/hardware.md`.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![deny(unsafe_code)]

mod parts;

#[cfg(target_os = "none")]
mod application;
#[cfg(target_os = "none")]
mod clocks;
#[cfg(target_os = "none")]
mod hse_timer;
#[cfg(target_os = "none")]
mod memory;
#[cfg(target_os = "none")]
mod reset;
#[cfg(all(target_os = "none", feature = "uart"))]
mod uart;

board_stm32::pin_rows!("### NUCLEO-H743ZI2");
