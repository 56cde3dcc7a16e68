//! The part of a board between pipeline and port: session with the host, messages, frame queue.
//!
//! The firmware and host-sim run this code unchanged. It accesses no port, no registers and no
//! clock: every call takes the device time as an argument, in microseconds since boot.
//!
//! ```text
//! AcquiredSample --> Producer --Output--+
//!                                       v
//! bytes from the host ---------------> Session --ToHost--> Sender --> FrameRing --> port
//!                                       |
//! acquisition <--Order------------------+
//! ```
//!
//! ```
//! use device::{Abilities, Counts, FrameRing, Identity, NoSlot, Sender, Session};
//! use link::{Decoder, Encoder, MAX_FRAME, ResetCause, ToDevice, ToHost};
//!
//! let identity = Identity {
//!     firmware: "0.1.0",
//!     board: "example",
//!     chip_uid: [0; 12],
//!     session_id: 1,
//!     reset_cause: ResetCause::PowerOn,
//!     fault: "",
//! };
//! let mut session = Session::new(identity, Abilities::CODES, pipeline::Mains::Hz50);
//! let mut sender = Sender::new(FrameRing::<4096>::new());
//!
//! let mut command = [0; MAX_FRAME];
//! let ping = Encoder::starting_at(7).encode(0, &ToDevice::Ping, &mut command)?;
//! session.receive(ping, 1_000, Counts::default(), &mut NoSlot, &mut sender, |_order| ());
//!
//! let mut frame = [0; MAX_FRAME];
//! let mut answer: &[u8] = sender.queue().pop(&mut frame).expect("an answer waits");
//! let mut host = Decoder::<MAX_FRAME>::new();
//! let answer = host.next::<ToHost>(&mut answer).expect("a whole frame");
//! assert!(matches!(answer?.message, ToHost::Ack(ack) if ack.of == 7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod acquired_sample;
mod audited_window;
mod board;
mod chunk;
mod converters;
mod encoders;
mod impedance;
mod message;
mod model_slot;
mod producer;
mod sender;
mod session;

pub use acquired_sample::{AcquiredSample, Counts, Marks};
pub use audited_window::AuditedWindow;
pub use board::{Abilities, Identity, Order, Run};
pub use chunk::{Chunk, CompressedChunk, FilteredChunk, RawChunk};
pub use converters::{
    CHIPS, CONVERTER_SETTINGS, EXCITED, converters_message, fault_text, self_test_message,
};
pub use encoders::{BothEncoders, Encoders, streams_with};
pub use impedance::Impedance;
pub use message::CODE_FORMAT;
pub use model_slot::{ModelSlot, NoSlot, Slot, UploadedWeights};
pub use producer::{CapturedEvent, Output, Payload, Producer};
pub use sender::{FrameQueue, FrameRing, MAX_FRAME, Sender};
pub use session::Session;
