//! Port to the host: USB, or with the feature `uart` a UART.
//!
//! The modules `usb_stream` and `uart_stream` are independent of the chip, so their tests run on a
//! PC.

#[cfg(all(target_os = "none", feature = "uart"))]
mod uart;
#[cfg(any(test, feature = "uart"))]
mod uart_stream;
#[cfg(all(target_os = "none", not(feature = "uart")))]
mod usb;
#[cfg(any(test, not(feature = "uart")))]
mod usb_stream;

#[cfg(all(target_os = "none", feature = "uart"))]
pub use uart::{Port, PortMemory, Uart, UartInterrupt};
#[cfg(all(target_os = "none", not(feature = "uart")))]
pub use usb::Port;
