//! Lossless compression of blocks of samples with several channels of 24-bit counts.
//!
//! ```text
//! samples --> differences --> adaptive Rice codes --> Block --> Decoder --> samples
//! 24 bits     order 0 to 3,   k from the mean of                            the same bits
//!             per channel     the channel's past
//! ```
//!
//! A [`Kind::Key`] block needs no past. A [`Kind::Continuing`] block needs every block since the
//! key block before it. A block that would take more bytes than its counts becomes
//! [`Kind::Verbatim`], the counts themselves: no block is longer than its counts.
//! `docs/wire-format.md` has the format bit by bit.
//!
//! Each channel costs a bounded number of instructions whatever the counts. [`Encoder::encode`]
//! does not allocate, divide or panic. [`Decoder::decode`] refuses a block that is damaged or
//! continues from blocks that it has not decoded, and never panics.
//!
//! ```
//! use lossless::{Decoder, Encoder, EncoderState, MAX_SAMPLES};
//!
//! // Two channels, 8 samples: a ramp, and a constant.
//! let samples: [_; MAX_SAMPLES] = core::array::from_fn(|t| [[t as u8, 1, 0], [7, 7, 0xff]]);
//! let encoder = Encoder { key_blocks: 16 };
//! let mut state = EncoderState::NEW;
//! let mut room = [[[0; 3]; 2]; MAX_SAMPLES];
//! let mut decoder = Decoder::<2>::NEW;
//! for _ in 0..3 {
//!     let block = encoder.encode(&mut state, &samples, &mut room);
//!     assert!(block.bytes.len() < 2 * 3 * MAX_SAMPLES);
//!     assert_eq!(decoder.decode(2, &block)?, samples.as_flattened());
//! }
//! # Ok::<(), lossless::DecodeError>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod block;
mod channel;
mod decoder;
mod encoder;
mod rice;

pub use block::{Block, Count, Kind, MAX_SAMPLES};
pub use decoder::{DecodeError, Decoder};
pub use encoder::{Encoder, EncoderState};
