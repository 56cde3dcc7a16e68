//! Reasons why a block cannot be decoded.

use core::fmt;

use crate::block::MAX_SAMPLES;

/// Reason why a block was refused. After any of them the decoder needs a block without a past.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// The block has no samples, or more than [`MAX_SAMPLES`].
    Samples(usize),
    /// The block has no channels, or more than the decoder.
    Channels(usize),
    /// The block continues from blocks that were not decoded, or from blocks with another number of
    /// channels.
    NoKey,
    /// The block ends too early.
    TooShort,
    /// The block goes on after its last count.
    TooLong,
    /// The parameter k of a channel is too large.
    Parameter(u32),
    /// A count has more than 24 bits.
    Range(i32),
    /// The counts do not add up to the block's sum: the block is damaged, or it does not continue from
    /// the previous one.
    Sum,
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Samples(samples) => {
                write!(f, "{samples} samples; 1 to {MAX_SAMPLES} are allowed")
            }
            Self::Channels(channels) => write!(f, "unexpected number of channels, {channels}"),
            Self::NoKey => f.write_str("the blocks that this one continues from are missing"),
            Self::TooShort => f.write_str("the block ends before its last count"),
            Self::TooLong => f.write_str("the block goes on after its last count"),
            Self::Parameter(k) => write!(f, "the parameter of a channel's codes is {k}, above 24"),
            Self::Range(count) => write!(f, "the count {count} has more than 24 bits"),
            Self::Sum => f.write_str("the counts do not add up to the block's sum"),
        }
    }
}

impl core::error::Error for DecodeError {}
