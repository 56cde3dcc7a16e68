//! What the boards with an STM32 share: everything between their pins and [`firmware`]'s tasks.
//!
//! A board's own crate says which pins, clocks and memories, and hands a [`Board`] to [`begin`]. On a PC
//! only the pins' table is there.
#![no_std]
#![deny(unsafe_code)]

#[cfg(test)]
extern crate std;

#[cfg(any(test, target_os = "none"))]
mod clock_source;
mod parts;
#[cfg(any(test, target_os = "none"))]
mod trigger_line;
#[cfg(any(test, all(target_os = "none", feature = "uart")))]
mod uart_port;
#[cfg(any(test, all(target_os = "none", not(feature = "uart"))))]
mod usb_port;

#[cfg(any(test, target_os = "none"))]
pub use clock_source::ClockSource;
pub use parts::{Pin, are_documented};

#[cfg(target_os = "none")]
mod application;
#[cfg(target_os = "none")]
mod bus;
#[cfg(target_os = "none")]
mod converter;
#[cfg(target_os = "none")]
mod delay;
#[cfg(target_os = "none")]
mod drdy;
#[cfg(target_os = "none")]
mod failure;
#[cfg(target_os = "none")]
mod interrupts;
#[cfg(target_os = "none")]
mod loader;
#[cfg(all(target_os = "none", feature = "uart"))]
#[path = "uart.rs"]
mod port;
#[cfg(all(target_os = "none", not(feature = "uart")))]
#[path = "usb.rs"]
mod port;
#[cfg(target_os = "none")]
mod time_driver;
#[cfg(target_os = "none")]
mod trigger;
#[cfg(all(target_os = "none", not(feature = "uart")))]
mod usb_recovery;

#[cfg(all(target_os = "none", feature = "uart"))]
pub use port::{PortMemory, Uart, UartInterrupt};
#[cfg(target_os = "none")]
pub use {
    application::{Board, begin, sleep, watch},
    bus::{Bus, FRAME_BYTES},
    converter::{CHIPS, Wires},
    interrupts::prioritise,
    loader::Loader,
    port::Port,
    time_driver::init,
    trigger::Trigger,
};
