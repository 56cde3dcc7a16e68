//! What a board does between its pipeline and its port, without time, port or registers: the firmware
//! and host-sim run the same.
//!
//! ```text
//! bytes from the host --Session--> Order to the acquisition, answers --Sender--> frames --FrameRing--> port
//! codes, quality, counts --Session--^
//! ```
//!
//! Time is an argument everywhere: the device clock in microseconds since boot.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod abilities;
mod audited_window;
mod converters;
mod counts;
mod fault_text;
mod filtered_chunk;
mod frame_ring;
mod identity;
mod made;
mod marks;
mod message;
mod producer;
mod raw_chunk;
mod sender;
mod session;
mod taken;

pub use abilities::Abilities;
pub use audited_window::AuditedWindow;
pub use converters::{converters, self_test};
pub use counts::Counts;
pub use fault_text::fault_text;
pub use filtered_chunk::FilteredChunk;
pub use frame_ring::FrameRing;
pub use identity::Identity;
pub use made::{Made, What};
pub use marks::Marks;
pub use message::CODE_FORMAT;
pub use producer::{Captured, Producer};
pub use raw_chunk::RawChunk;
pub use sender::{FrameQueue, Sender};
pub use session::{Order, Run, Session};
pub use taken::Taken;
