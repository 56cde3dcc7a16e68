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
mod frame_ring;
mod identity;
mod message;
mod sender;
mod session;

pub use abilities::Abilities;
pub use frame_ring::FrameRing;
pub use identity::Identity;
pub use message::CODE_FORMAT;
pub use sender::{FrameQueue, Sender};
pub use session::{Counts, Marks, Order, Run, Session};
