//! The USB port: a model of the core in the microcontroller, and a host at the other end of the cable.
//!
//! The core is Synopsys's OTG controller in device mode at full speed with FIFO access by the processor,
//! after RM0433 rev 9 chapter 57 (STM32H743) and RM0390 chapter 31 (STM32F446). Where the manuals leave
//! open what the core does, the model does what drivers found on silicon; the item says so.
//!
//! The host enumerates the device as Linux does, drives it as a CDC-ACM serial port, and judges what it
//! gets: descriptors, data toggles, lengths and times.
//!
//! [`Otg`] goes into a part as a field: `split` asks [`Otg::model`] first, `poll` and `reset` call those of
//! the part and then [`Otg::poll`] and [`Otg::reset`], and [`redirect`] lets the processor reach the window
//! by the core's own addresses.
//!
//! Not modelled: host mode, DMA, isochronous endpoints, LPM, battery charging, transmission errors and lost
//! handshakes, and signals on the wires.

mod core;
mod endpoint;
mod fifo;
mod handle;
mod host;
mod instance;
mod otg;
mod register;
mod violation;

pub use self::handle::{Counters, State, UsbHost};
pub use self::host::{Configuration, Descriptors, EndpointDescriptor, Event, Interface, Logged};
pub use self::instance::{F446_OTG_FS, H743_USB2, Instance};
pub use self::otg::Otg;
pub use self::violation::Violation;
