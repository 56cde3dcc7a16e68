//! The application that every board runs: three tasks from the analogue-to-digital converters to
//! the port.
//!
//! ```text
//! Converter --> acquire --SampleSlot--> encode --OutputSlot--> converse --> Port
//! (board)       filters,                encoder,               frames out,  (board)
//!               512 Hz                  128 Hz                 commands in
//! ```
//!
//! Each task has an interrupt priority of its own: `acquire` preempts `converse`, which preempts
//! `encode`. No task waits for a less urgent one. A full queue drops the next item and counts it,
//! and the host receives the count. [`deadlines`] lists every rate, deadline and priority with its
//! derivation.
//!
//! A board provides a [`Converter`], a [`Port`] (embedded-io-async) and the executors. It declares
//! the tasks itself, because an embassy task cannot be generic.
//!
//! # Example
//! Half a second of synthetic samples passes through acquisition and encoder.
//!
//! ```
//! use core::{future::pending, pin::pin, task::Poll};
//!
//! use device::{BothEncoders, Order, Payload, Run};
//! use embassy_futures::{join::join, poll_once, yield_now};
//! use firmware::{Clock, Conversion, Converter, Memory, Shared, acquire, encode};
//! use link::Streams;
//! use pipeline::Sample;
//!
//! /// A square wave of 256 samples.
//! struct Square(u64);
//!
//! impl Converter for Square {
//!     async fn next(&mut self, sample: &mut Sample) -> Conversion {
//!         if self.0 == 256 {
//!             pending::<()>().await;
//!         }
//!         yield_now().await;
//!         self.0 += 1;
//!         sample.counts.fill(if self.0 % 32 < 16 { 1_000 } else { -1_000 });
//!         Conversion { drdy_us: self.0 * 1_953, ..Conversion::default() }
//!     }
//! }
//!
//! static MEMORY: Memory<BothEncoders> = Memory::new(BothEncoders::EMPTY);
//! static SHARED: Shared = Shared::new(Clock { now: || 0, hz: 1_000_000 });
//!
//! let memory = MEMORY.init();
//! let (_frames, mut outputs) = memory.converse;
//! SHARED.send_order(Order::Start(Run { streams: Streams::CODES, ..Run::NONE }));
//! let mut tasks = pin!(join(
//!     acquire(Square(0), &SHARED, memory.acquire),
//!     encode(&SHARED, memory.encode),
//! ));
//! let mut codes = 0;
//! for _ in 0..=256 {
//!     assert!(poll_once(tasks.as_mut()).is_pending());
//!     while let Poll::Ready((output, _)) = poll_once(outputs.receive()) {
//!         codes += u32::from(matches!(output.payload, Payload::Code(..)));
//!         outputs.receive_done();
//!     }
//! }
//! assert_eq!(SHARED.counts().samples, 256);
//! // 64 steps: a window of 16, then a code for every hop of 8.
//! assert_eq!(codes, 7);
//! ```
#![no_std]
#![deny(unsafe_code)]

#[cfg(test)]
extern crate std;

mod acquire;
mod converse;
mod converter;
pub mod deadlines;
mod encode;
#[cfg(target_os = "none")]
pub mod failure;
mod fault_record;
mod inputs;
mod memory;
mod progress;
mod queues;
mod shared;
mod shared_slot;
mod stack;
mod timing;

pub use acquire::acquire;
pub use converse::{Machine, Port, converse};
pub use converter::{Conversion, Converter};
pub use encode::encode;
pub use fault_record::{FaultRecord, MODEL_DAMAGED, start_fault};
pub use inputs::Inputs;
pub use memory::{Frames, Memory, TaskMemory};
pub use progress::{Progress, keep_alive};
pub use queues::{
    BulkSlot, OutputReceiver, OutputSender, OutputSlot, RawMutex, SampleReceiver, SampleSender,
    SampleSlot, output_queue,
};
pub use shared::Shared;
pub use shared_slot::SharedSlot;
pub use stack::Stack;
pub use timing::Clock;
