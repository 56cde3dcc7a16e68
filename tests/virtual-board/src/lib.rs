//! The NUCLEO boards on emulated microcontrollers.

pub mod usb;
