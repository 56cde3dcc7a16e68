//! The wire format between board and host, for both ends.
//!
//! [`Encoder`] numbers messages and writes them as frames. [`Decoder`] finds frames in any byte
//! stream and counts the frames it refuses. The same bytes run over USB, UART, TCP and a
//! pseudo-terminal. `docs/wire-format.md` has the field tables, and real frames as hex dumps.
//!
//! ```text
//! board                                                                       host
//! ToHost   --> Encoder --> 00 COBS(header, message, CRC-32C) 00 --> Decoder --> ToHost
//! ToDevice <-- Decoder <-- 00 COBS(header, message, CRC-32C) 00 <-- Encoder <-- ToDevice
//! ```
//!
//! Header and message are serialised with postcard. A zero byte on both sides of a frame limits the
//! damage: garbage, a reset or a lost byte costs the frame it hits and at most one more frame.
//!
//! ```
//! use link::{Decoder, Encoder, MAX_FRAME, Start, Streams, ToDevice};
//!
//! let start = ToDevice::Start(Start { streams: Streams::CODES, mains_hz: 50 });
//! let mut buffer = [0; MAX_FRAME];
//! let frame = Encoder::default().encode(0, &start, &mut buffer)?;
//!
//! let bytes = [b"line noise", frame].concat();
//! let mut input = &bytes[..];
//! let mut decoder = Decoder::<MAX_FRAME>::new();
//! let noise = decoder.next::<ToDevice>(&mut input).expect("bytes before a zero");
//! assert!(noise.is_err());
//! let received = decoder.next::<ToDevice>(&mut input).expect("a whole frame");
//! assert_eq!(received.map(|frame| frame.message), Ok(start));
//! assert_eq!(decoder.counters().resyncs, 1);
//! # Ok::<(), link::EncodeError>(())
//! ```
//!
//! # Compatibility
//!
//! * [`VERSION`] is the version of the layout of frame and header and changes only with that
//!   layout. A frame of another version is refused and counted ([`FrameError::Version`]).
//! * New messages are added only at the end of [`ToHost`] and [`ToDevice`]. Fields of an existing
//!   message never change; a message that must carry more is a new message. A message that is newer
//!   than the receiver is reported as [`FrameError::Unknown`]: its frame is intact, and its `seq`
//!   counts as received.
//! * A device answers a command that it does not know with [`AckResult::UnknownCommand`]. The host
//!   then uses only the commands that both sides know.
//! * [`ResetCause`], [`AckResult`], [`ChannelFault`], [`CodeFormat`], [`BlockForm`], [`Stage`],
//!   [`EventKind`] and [`ResetInto`] are one byte on the wire; a value that the receiver does not
//!   know is kept as a number. [`Flags`] and [`Streams`] keep bits that the receiver does not know.
#![no_std]
#![forbid(unsafe_code)]

#[macro_use]
mod wire_type;

mod code;
mod commands;
mod converters;
mod decoder;
mod encoder;
mod features;
mod flags;
mod frame;
mod introduction;
mod message;
mod reports;
mod signal;
mod upload;

pub use code::{
    Audit, Code, CodeFormat, CodeValues, MAX_EXPONENT, MAX_NUMBERS, MAX_RATE, PackedCode,
};
pub use commands::{Ack, AckResult, ClockReading, ExclusionPolicy, ResetInto, Start, Streams};
pub use converters::{ChannelFault, ChannelTest, ChipTest, Converters, MAX_CHIPS, SelfTest};
pub use decoder::{Counters, Decoder, Frame, FrameError};
pub use encoder::{EncodeError, Encoder, encode};
pub use features::{BandPass, FeatureFilters, Features, MAX_FEATURES};
pub use flags::Flags;
pub use frame::{Header, MAX_BODY, MAX_FRAME, VERSION, frame_bytes};
pub use introduction::{
    Capabilities, Hello, MAX_LABELS_BYTES, MAX_TEXT_BYTES, ResetCause, Substitutes,
};
pub use message::{Message, ToDevice, ToHost};
pub use reports::{
    ElectrodeQuality, Exclusion, Impedance, MAX_ELECTRODES, MAX_STAGES, Quality, Stage,
    StageTiming, Stats, Timing,
};
pub use signal::{
    BlockForm, COUNT_BYTES, CompressedRaw, Event, EventKind, FILTERED_STEPS, Filtered, RAW_SAMPLES,
    Raw, VALUE_BYTES,
};
pub use upload::{MAX_CHUNK_BYTES, ModelBegin, ModelChunk, ModelReceived, model_crc};
