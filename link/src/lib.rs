//! The wire format between board and host, both ends.
//!
//! A frame is `0x00 COBS(postcard(Header) ++ postcard(message) ++ CRC-32C LE) 0x00`. The zeros on
//! both sides mean that after garbage, a reset or a lost byte at most one frame is lost beside the
//! one that was hit. The same bytes run over USB, UART, TCP and a PTY; `docs/wire-format.md` has
//! the field tables and real frames as hex dumps.
//!
//! Messages: [`ToHost`] from board to host, [`ToDevice`] the other way. [`Encoder`] makes frames
//! and numbers them; [`Decoder`] finds them in any byte stream and counts what it could not use.
//!
//! # Compatibility
//!
//! * [`VERSION`] names the frame and the header. It changes only if these change; a frame of
//!   another version is refused and counted, and the decoder remembers which version it was.
//! * Both enums only grow, at their end. Fields of an existing message never change; a message
//!   that must carry more is a new message. A message newer than the receiver is
//!   [`FrameError::Unknown`]: a sound frame (its `seq` counts as received), never corruption.
//! * A device answers a command that it does not know with [`AckResult::UnknownCommand`], so an
//!   old device tells a new host so, and the host goes on with what both know.
//! * Lists of reasons ([`ResetCause`], [`AckResult`], [`ChannelFault`]), [`CodeFormat`], [`Stage`],
//!   [`EventKind`] and [`ResetInto`] travel as one byte and keep a value that the receiver does not know; bit sets ([`Flags`], [`Streams`]) keep their
//!   unknown bits.
#![no_std]
#![forbid(unsafe_code)]

mod ack;
mod array;
mod audit;
mod bytes;
mod capabilities;
mod clock_reading;
mod code;
mod code_values;
mod converters;
mod decoder;
mod encoder;
mod event;
mod filtered;
mod flags;
mod header;
mod hello;
mod message;
mod quality;
mod raw;
mod reset;
mod self_test;
mod start;
mod stats;
mod timing;

pub use ack::{Ack, AckResult};
pub use audit::Audit;
pub use capabilities::{Capabilities, MAX_LABELS_BYTES};
pub use clock_reading::ClockReading;
pub use code::Code;
pub use code_values::{CODE_LEN, CodeFormat, CodeValues, MAX_EXPONENT};
pub use converters::{Converters, MAX_CHIPS};
pub use decoder::{Counters, Decoder, Frame, FrameError};
pub use encoder::{EncodeError, Encoder, MAX_BODY, MAX_FRAME, encode};
pub use event::{Event, EventKind};
pub use filtered::{FILTERED_STEPS, Filtered, VALUE_BYTES};
pub use flags::Flags;
pub use header::{Header, VERSION};
pub use hello::{Hello, MAX_TEXT_BYTES, ResetCause};
pub use message::{Message, ToDevice, ToHost};
pub use quality::{ElectrodeQuality, MAX_ELECTRODES, Quality};
pub use raw::{COUNT_BYTES, RAW_SAMPLES, Raw};
pub use reset::ResetInto;
pub use self_test::{ChannelFault, ChannelTest, ChipTest, SelfTest};
pub use start::{Start, Streams};
pub use stats::Stats;
pub use timing::{MAX_STAGES, Stage, StageTiming, Timing};
