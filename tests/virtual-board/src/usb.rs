//! USB: a model of the microcontroller's USB core, and a host at the other end of the cable.
//!
//! The core is Synopsys's OTG controller in device mode at full speed, with FIFO access by the
//! processor. The model follows RM0433 rev 9 chapter 57 (STM32H743) and RM0390 chapter 31
//! (STM32F446). Where the manuals leave behaviour open, the model does what driver authors have
//! found on real chips, and a comment says so.
//!
//! The host enumerates the device as Linux does, uses it as a CDC-ACM serial port, and checks
//! descriptors, data toggles, lengths and response times. A test controls the host with
//! [`UsbHost`].
//!
//! Not modelled are host mode, DMA, isochronous endpoints, LPM, battery charging, transmission
//! errors, lost handshakes and electrical signals.

mod core;
mod endpoint;
mod fifo;
pub(crate) mod host;
pub(crate) mod instance;
pub(crate) mod otg;
mod register;
mod violation;

pub use self::host::descriptor::Descriptors;
pub use self::host::{Command, State, UsbHost};
pub use self::violation::Violation;
