//! The application that every board runs.
//!
//! ```text
//! Converter ---> [acquire] --Taken--> [encode] --Made--> [converse] ---> Port
//!  board's        every      sample    lowest   code      commands in,    board's
//!                 sample     and step  priority quality   frames out
//! ```
//!
//! Each bracket is a task, none waits for one of a lower priority: what a slower one has no room for
//! is counted, and the host learns of it. [`deadlines`] says what is due when, and why.
//!
//! Boards give a [`Converter`], a port (embedded-io-async) and executors, and nothing else; tasks are
//! spawned by them because a task is not generic.
#![no_std]
#![deny(unsafe_code)]

#[cfg(test)]
extern crate std;

mod acquire;
mod converse;
mod converter;
pub mod deadlines;
mod encode;
mod fault_record;
mod inputs;
mod kept;
mod memory;
mod model_check;
mod progress;
mod shared;
mod stack;
mod stamped;
mod start_fault;
mod timing;

pub use acquire::acquire;
pub use converse::{Machine, Port, converse};
pub use converter::{Conversion, Converter};
pub use encode::encode;
pub use fault_record::FaultRecord;
pub use inputs::Inputs;
pub use kept::Kept;
pub use memory::{Frames, HandedIn, HandedOut, Memory, Shares, StampedIn, StampedOut};
pub use model_check::{MODEL_DAMAGED, model_is_sound};
pub use progress::{Progress, keep_alive};
pub use shared::{Mutex, Shared};
pub use stack::Stack;
pub use stamped::{Handed, Stamped};
pub use start_fault::start_fault;
pub use timing::Clock;
