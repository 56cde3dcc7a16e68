//! Everything that the boards with an STM32 share, between their pins and the tasks of `firmware`.
//!
//! ```text
//! DRDY ----edge---> [drdy] --time stamp--+
//! ADS1299    --SPI--> [bus] --counts--> [converter] --> firmware's tasks <--> [port] <--> USB or UART
//! TRIGGER --TIM2 capture--> [trigger] ----events---------------^
//! panic, hard fault --> [failure] --record--> reset --> [application] --> Hello
//! ```
//!
//! The crate of a board defines pins, clocks and memory, and passes them to `start_tasks` as a
//! `Board`. For the microcontroller this crate compiles only as part of a board, which selects the
//! chip. On a PC it contains the table of pins and the logic that needs no chip.
#![no_std]
#![deny(unsafe_code)]

#[cfg(test)]
extern crate std;

#[cfg(target_os = "none")]
mod application;
#[cfg(target_os = "none")]
mod bus;
#[cfg(any(test, target_os = "none"))]
mod clock_source;
#[cfg(target_os = "none")]
mod converter;
#[cfg(target_os = "none")]
mod drdy;
#[cfg(target_os = "none")]
mod failure;
#[cfg(target_os = "none")]
mod interrupts;
#[cfg(target_os = "none")]
mod loader;
pub mod parts;
#[cfg(any(test, target_os = "none"))]
mod port;
#[cfg(all(target_os = "none", feature = "stm32f4"))]
pub mod stm32f4;
#[cfg(target_os = "none")]
mod trigger;
#[cfg(any(test, target_os = "none"))]
mod trigger_line;

#[cfg(any(test, target_os = "none"))]
pub use clock_source::{ClockSource, HSE_DIVIDER, HseInput, HseTimer, KnownClock};
#[cfg(all(target_os = "none", feature = "uart"))]
pub use port::{PortMemory, Uart, UartInterrupt};
#[cfg(target_os = "none")]
pub use {
    application::{Board, feed_watchdog, sleep, start_tasks, start_watchdog},
    bus::{Bus, FRAME_BYTES},
    converter::Wires,
    interrupts::{init_chip, nvic_priority},
    loader::Loader,
    port::Port,
    trigger::Trigger,
};
