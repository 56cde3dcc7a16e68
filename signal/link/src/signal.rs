//! Signals and events, streamed on request.

use serde::{Deserialize, Serialize, Serializer};

use crate::flags::Flags;

/// Largest number of samples that a device puts into a [`Raw`]. Eight samples of 64 channels take
/// 1536 bytes of the body.
pub const RAW_SAMPLES: usize = 8;

/// Size of a count in [`Raw::counts`], bytes.
pub const COUNT_BYTES: usize = 3;

/// Largest number of steps that a device puts into a [`Filtered`]. Four steps of 61 electrodes take
/// 976 bytes of the body.
pub const FILTERED_STEPS: usize = 4;

/// Size of a value in [`Filtered::values`], bytes.
pub const VALUE_BYTES: usize = 4;

/// Consecutive unfiltered ADC samples of all channels; sent if requested.
///
/// The header holds the time of the last sample's DRDY edge.
///
/// ```
/// # use link::{Flags, Raw};
/// let raw = Raw {
///     first_sample: 0,
///     channels: 2,
///     flags: Flags::empty(),
///     counts: &[1, 0, 0, 0xff, 0xff, 0xff, 2, 0, 0, 0, 0, 0x80],
/// };
/// assert!(raw.counts().eq([1, -1, 2, -(1 << 23)]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Raw<'a> {
    /// Index of the first sample, counted from `Start`. The next frame's index is this index plus
    /// the number of samples in this frame; a higher one means that samples were lost.
    pub first_sample: u64,
    /// Number of channels, each with one count per sample; 64 on a chain of eight ADS1299.
    pub channels: u8,
    /// Faults of the samples in this frame: `ADC_STATUS_BAD`, `LEAD_OFF`, `OVERRUN`.
    pub flags: Flags,
    /// All counts of the first sample in the order of the channels, then the counts of the next
    /// sample; 24 bits each in two's complement, least significant byte first.
    #[serde(borrow, serialize_with = "serialize_bytes")]
    pub counts: &'a [u8],
}

impl Raw<'_> {
    /// Returns the counts in wire order, |count| <= 2^23; a truncated last count is omitted.
    pub fn counts(&self) -> impl Iterator<Item = i32> {
        let (counts, _) = self.counts.as_chunks::<COUNT_BYTES>();
        // Shift the 24 bits to the top and back down, which extends the sign.
        counts.iter().map(|&[low, middle, high]| i32::from_le_bytes([0, low, middle, high]) >> 8)
    }
}

/// Consecutive filtered steps of all electrodes at the encoder's step rate, before quantisation;
/// sent if requested.
///
/// The header holds the time of the last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Filtered<'a> {
    /// Index of the first step, counted from `Start`. The next frame's index is this index plus the
    /// number of steps in this frame; a higher one means that steps were lost.
    pub first_step: u64,
    /// Electrodes per step, in the order of [`Capabilities::labels`](crate::Capabilities::labels).
    pub electrodes: u8,
    /// Fraction bits of a value: `value * Capabilities::lsb_nv / 2^fraction_bits` is in nanovolt.
    pub fraction_bits: u8,
    /// Faults of the samples from which these steps were computed: `ADC_STATUS_BAD`, `LEAD_OFF`,
    /// `OVERRUN`, `SATURATED`, `SETTLING`.
    pub flags: Flags,
    /// All values of the first step in the order of the electrodes, then the values of the next
    /// step; 32 bits each in two's complement, least significant byte first.
    #[serde(borrow, serialize_with = "serialize_bytes")]
    pub values: &'a [u8],
}

impl Filtered<'_> {
    /// Returns the values in wire order; a truncated last value is omitted.
    pub fn values(&self) -> impl Iterator<Item = i32> {
        let (values, _) = self.values.as_chunks::<VALUE_BYTES>();
        values.iter().map(|&value| i32::from_le_bytes(value))
    }
}

/// The samples of a [`Raw`], compressed without loss; sent if requested.
///
/// The header holds the time of the last sample's DRDY edge. `docs/wire-format.md` has the format
/// of the bytes, which never take more than the 3 bytes for each count that a `Raw` takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompressedRaw<'a> {
    /// Index of the first sample, counted from `Start`. The next frame's index is this index plus
    /// `samples`; a higher one means that samples were lost.
    pub first_sample: u64,
    /// Number of channels, each with one count per sample; 64 on a chain of eight ADS1299.
    pub channels: u8,
    /// Faults of the samples in this frame: `ADC_STATUS_BAD`, `LEAD_OFF`, `OVERRUN`.
    pub flags: Flags,
    /// Form of `bytes`; it determines whether a host needs earlier blocks to decode them.
    pub form: BlockForm,
    /// Number of samples, 1 to [`RAW_SAMPLES`].
    pub samples: u8,
    /// The counts, encoded as `form` states.
    #[serde(borrow, serialize_with = "serialize_bytes")]
    pub bytes: &'a [u8],
}

byte_enum! {
    /// Form of a block of compressed samples; one byte on the wire.
    pub enum BlockForm {
        /// 0: the counts, not compressed, as in [`Raw`].
        Verbatim = 0,
        /// 1: compressed; needs no other block.
        Key = 1,
        /// 2: compressed; needs the blocks since the last key block.
        Continuing = 2,
        _ => "Any other: newer than this host.",
    }
}

/// An edge at one of the device's inputs; sent if requested.
///
/// The header holds the time of the edge itself, at the resolution of the device's clock, so that
/// an experiment's trigger can be placed between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// Input and direction of the edge.
    pub kind: EventKind,
    /// Sequence number of the event, counted since boot over all kinds; wraps. A gap means that
    /// events were lost.
    pub number: u32,
    /// Index, counted from `Start`, of the first ADC sample whose DRDY edge was at or after the
    /// event.
    pub sample: u64,
}

byte_enum! {
    /// Input and direction of an edge; one byte on the wire.
    pub enum EventKind {
        /// 0: the trigger input went high.
        TriggerRise = 0,
        /// 1: the trigger input went low.
        TriggerFall = 1,
        _ => "Any other: a kind newer than this host.",
    }
}

/// Writes a byte slice in one piece: varint length, then the bytes. Used as `serialize_with`.
///
/// Serde's derive produces the same bytes for a `&[u8]`, but with one call per byte.
pub(crate) fn serialize_bytes<S: Serializer>(
    bytes: &&[u8],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_bytes(bytes)
}
