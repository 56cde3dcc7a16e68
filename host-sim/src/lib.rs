//! The board without a board: sources, virtual board, ports.
//!
//! The same pipeline and link as on a microcontroller, bit for bit, behind a pseudo-terminal, a TCP
//! port or a file:
//!
//! ```text
//! Source ------> Converters ------> VirtualBoard ------> Outbox ------> Port
//! recording or   simulated chain,   pipeline + link,     whole frames,  pty, tcp
//! synthetic EEG  real driver        answers commands     drops oldest   or file
//! ```
#![forbid(unsafe_code)]

mod converters;
mod device_clock;
mod fault;
mod outbox;
mod port;
mod session;
mod source;
pub mod synthetic;
mod trigger;
mod virtual_board;

pub use converters::{CHIPS, Converted, Converters};
pub use device_clock::{DeviceClock, Pace};
pub use fault::{FAULTS, Fault, FaultError, Faults};
pub use outbox::{Outbox, WhenFull};
pub use port::{Output, Port, PortError};
pub use session::{Report, Session, SessionError};
pub use source::Source;
pub use trigger::{Trigger, TriggerError};
pub use virtual_board::{Identity, VirtualBoard};
