//! A virtual board: passes EEG through simulated converters and the firmware's pipeline to a port.
//!
//! The converter driver, the pipeline and the link are the firmware's code, so the codes equal a
//! board's bit for bit. The program `host-sim` is the command line of [`Session`].
//!
//! ```text
//! Source -------> Converters -------> VirtualBoard ------> Outbox ------> Port
//! recording or    simulated chain,    pipeline, link,      whole frames,  PTY, TCP
//! synthetic EEG   real driver         commands             drops oldest   or file
//! ```
//!
//! This example encodes one second of synthetic EEG without a host:
//!
//! ```
//! use host_sim::synthetic::{Generator, SyntheticSpec};
//! use host_sim::{Identity, Outbox, VirtualBoard, WhenFull};
//! use link::{Start, Streams};
//! use pipeline::{Mains, Sample};
//!
//! let identity = Identity { session_id: 1, ..Identity::default() };
//! let outbox = Outbox::new(WhenFull::DropOldest);
//! let mut board = VirtualBoard::new(identity, Mains::Hz50, outbox);
//! board.start(Start { streams: Streams::CODES, mains_hz: 0 }, 0);
//!
//! let eeg = Generator::new(&SyntheticSpec::new(1, model::LABELS.split(' ')))?;
//! for (index, counts) in (0..512).zip(eeg) {
//!     board.process_sample(&Sample { counts }, index * 1_000_000 / 512);
//! }
//! // 128 steps: the first code after 16 of them, then one for every 8.
//! assert_eq!(board.stats().codes_made, 15);
//! # Ok::<(), host_sim::synthetic::SyntheticError>(())
//! ```
#![forbid(unsafe_code)]

mod contact;
mod converters;
mod fault;
mod outbox;
mod trigger;
mod virtual_board;

pub use contact::{Contact, ContactError};
pub use converters::{ConvertedSample, Converters};
pub use device::CHIPS;
pub use fault::{Fault, FaultError, Faults, help as fault_help};
pub use outbox::{Outbox, WhenFull};
pub use trigger::{Trigger, TriggerError};
pub use virtual_board::{Identity, VirtualBoard};

#[cfg(feature = "program")]
pub mod scenario;
#[cfg(feature = "program")]
mod session;
#[cfg(feature = "program")]
pub mod synthetic;

#[cfg(feature = "program")]
pub use session::{
    DeviceClock, FileRules, Output, Pace, Port, PortError, RecordedEdges, Report, Session,
    SessionError, Source,
};
