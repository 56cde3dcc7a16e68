//! All messages of both directions, in the order of their wire numbers.

use serde::{Deserialize, Serialize};

use crate::code::{Audit, Code, PackedCode};
use crate::commands::{Ack, ClockReading, ExclusionPolicy, ResetInto, Start};
use crate::converters::{Converters, SelfTest};
use crate::features::{FeatureFilters, Features, MAX_FEATURES};
use crate::introduction::{Capabilities, Hello, Substitutes};
use crate::reports::{Exclusion, Impedance, MAX_ELECTRODES, Quality, Stats, Timing};
use crate::signal::{CompressedRaw, Event, Filtered, Raw};
use crate::upload::{MAX_CHUNK_BYTES, ModelBegin, ModelChunk, ModelReceived};

/// The set of messages of one direction: [`ToHost`] or [`ToDevice`].
pub trait Message<'a>: Serialize + Deserialize<'a> {
    /// Number of messages in the set. A wire number of `KINDS` or more belongs to a message that is
    /// newer than this release.
    const KINDS: u32;
    /// Byte that enters the CRC before the header and is never sent. A frame of the other
    /// direction, such as an echo on a looped line, therefore fails the CRC and is not answered.
    const DIRECTION: u8;

    /// Returns the bytes that follow the fields of the message up to the end of the frame: the
    /// values of a code, a packed block, or a part of a model. Empty for most messages.
    fn tail(&self) -> &[u8] {
        &[]
    }

    /// Puts the bytes that follow the fields of a message into the decoded message and returns it;
    /// `None` if the message cannot have these bytes.
    fn with_tail(self, tail: &'a [u8]) -> Option<Self> {
        tail.is_empty().then_some(self)
    }
}

/// Messages from device to host. New variants are added only at the end, because a variant's
/// position is its number on the wire.
#[expect(
    clippy::large_enum_variant,
    reason = "no heap in no_std; a decoder holds one message at a time, about 1 KB"
)]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToHost<'a> {
    /// 0: identity of the device.
    #[serde(borrow)]
    Hello(Hello<'a>),
    /// 1: rates, dimensions, labels and the scales of the codes.
    #[serde(borrow)]
    Capabilities(Capabilities<'a>),
    /// 2: the code of one window.
    #[serde(borrow)]
    Code(Code<'a>),
    /// 3: counters since boot.
    Stats(Stats),
    /// 4: the answer to a command.
    Ack(Ack),
    /// 5: signal quality of each electrode in one second.
    Quality(Quality),
    /// 6: durations of the stages of the signal path.
    Timing(Timing),
    /// 7: unfiltered ADC samples.
    #[serde(borrow)]
    Raw(Raw<'a>),
    /// 8: filtered electrodes at the step rate.
    #[serde(borrow)]
    Filtered(Filtered<'a>),
    /// 9: the input planes of a window, with its code.
    #[serde(borrow)]
    Audit(Audit<'a>),
    /// 10: an edge at an input of the device.
    Event(Event),
    /// 11: status of the converters.
    Converters(Converters),
    /// 12: the result of a self-test of the converters.
    SelfTest(SelfTest),
    /// 13: the device's clock; the answer to `SyncTime`.
    ClockReading(ClockReading),
    /// 14: electrodes with substitute samples, because the recording being played lacks them.
    Substitutes(Substitutes),
    /// 15: unfiltered ADC samples, compressed without loss.
    #[serde(borrow)]
    CompressedRaw(CompressedRaw<'a>),
    /// 16: a block of the packed code.
    PackedCode(PackedCode<'a>),
    /// 17: electrodes that are excluded from codes and filled from the others.
    Exclusion(Exclusion),
    /// 18: how much of an announced model the device has; the answer to each command of an upload.
    ModelReceived(ModelReceived),
    /// 19: band powers of a hop.
    Features(Features<'a>),
    /// 20: impedance of each electrode.
    Impedance(Impedance<'a>),
}

impl<'a> Message<'a> for ToHost<'a> {
    const KINDS: u32 = 21;
    const DIRECTION: u8 = b'H';

    fn tail(&self) -> &[u8] {
        match self {
            ToHost::Code(code) => code.values.bytes(),
            ToHost::Audit(audit) => audit.values.bytes(),
            ToHost::PackedCode(code) => code.bytes,
            ToHost::Features(features) => features.levels,
            ToHost::Impedance(impedance) => impedance.ohms,
            _ => &[],
        }
    }

    fn with_tail(mut self, tail: &'a [u8]) -> Option<Self> {
        let (values, least) = match &mut self {
            ToHost::Code(code) => (&mut code.values, 1),
            // An audit may have no values: a device without a network sends none.
            ToHost::Audit(audit) => (&mut audit.values, 0),
            ToHost::PackedCode(code) => {
                code.bytes = tail;
                return Some(self);
            }
            ToHost::Features(features) => {
                features.levels = tail;
                return (1..=MAX_FEATURES).contains(&tail.len()).then_some(self);
            }
            ToHost::Impedance(impedance) => {
                impedance.ohms = tail;
                return Impedance::is_list(tail).then_some(self);
            }
            _ => return tail.is_empty().then_some(self),
        };
        *values = values.with_bytes(tail, least)?;
        Some(self)
    }
}

/// Messages from host to device. New variants are added only at the end, because a variant's
/// position is its number on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ToDevice<'a> {
    /// 0: start a run with the streams that the arguments name.
    Start(Start),
    /// 1: end the run and all its streams.
    Stop,
    /// 2: answer with `Hello` and `Capabilities`, and with `Converters` if there is a chain.
    Identify,
    /// 3: answer with an `Ack` only, to check that the link works.
    Ping,
    /// 4: test the converters with their internal signals; refused while any stream runs.
    /// [`ToHost::SelfTest`] carries the result.
    SelfTest,
    /// 5: answer with a `ClockReading`.
    SyncTime {
        /// The host's clock, microseconds; the answer repeats it.
        host_time_us: u64,
    },
    /// 6: restart, a tenth of a second after the `Ack`.
    Reset(ResetInto),
    /// 7: set the rate of the packed code from the next block on. Accepted at any time, also during
    /// a run; the device keeps the rate until it restarts.
    SetRate {
        /// New rate, 0 to [`MAX_RATE`](crate::MAX_RATE); any other is refused with `BadArgument`.
        /// Each step up quantises 3 dB more coarsely.
        rate: u8,
    },
    /// 8: set which electrodes are excluded, from the next half second on; kept until the device
    /// restarts. Refused with `NotSupported` by a device whose model cannot fill electrodes.
    SetExclusion(ExclusionPolicy),
    /// 9: announce a packed model, which replaces the model in use at `ModelEnd`. Until then, the
    /// device uses the model that it was built with. Refused with `Busy` while any stream runs, and
    /// with `NotSupported` by a device without a model slot.
    ModelBegin(ModelBegin),
    /// 10: a part of the announced model; refused with `BadArgument` if earlier bytes are missing.
    #[serde(borrow)]
    ModelChunk(ModelChunk<'a>),
    /// 11: use the announced model from now on, until the device restarts. The device introduces
    /// itself again, with the model's id. Answered with `Failed` if the model is not sound.
    ModelEnd,
    /// 12: compute features with these filters from the next step on. Accepted at any time, also
    /// during a run; the device keeps the filters until it restarts. Filters out of range are
    /// refused with `BadArgument`.
    SetFeatures(FeatureFilters<'a>),
    /// 13: start or end the measurement of the electrodes' impedance with the next sample; `Stop`
    /// ends it too. [`ToHost::Impedance`] carries the results. Refused with `NotSupported` by a
    /// device that cannot measure it, and with `Busy` at ADC rates below 500 Hz while filtered
    /// streams run.
    SetImpedance {
        /// True to start the measurement, false to end it.
        on: bool,
    },
}

impl<'a> Message<'a> for ToDevice<'a> {
    const KINDS: u32 = 14;
    const DIRECTION: u8 = b'D';

    fn tail(&self) -> &[u8] {
        match self {
            ToDevice::ModelBegin(begin) => &begin.id,
            ToDevice::ModelChunk(chunk) => chunk.bytes,
            ToDevice::SetFeatures(filters) => filters.weights,
            _ => &[],
        }
    }

    fn with_tail(mut self, tail: &'a [u8]) -> Option<Self> {
        match &mut self {
            ToDevice::ModelBegin(begin) => {
                begin.id = tail.try_into().ok()?;
                Some(self)
            }
            ToDevice::ModelChunk(chunk) => {
                chunk.bytes = tail;
                (1..=MAX_CHUNK_BYTES).contains(&tail.len()).then_some(self)
            }
            ToDevice::SetFeatures(filters) => {
                filters.weights = tail;
                (1..=MAX_FEATURES * MAX_ELECTRODES).contains(&tail.len()).then_some(self)
            }
            _ => tail.is_empty().then_some(self),
        }
    }
}

impl ToDevice<'_> {
    /// Returns the command without borrowed data, for callers that need it after its frame's buffer
    /// has been reused: a `ModelChunk` loses its bytes, `SetFeatures` its weights.
    #[must_use]
    pub const fn without_bytes(self) -> ToDevice<'static> {
        match self {
            ToDevice::Start(start) => ToDevice::Start(start),
            ToDevice::Stop => ToDevice::Stop,
            ToDevice::Identify => ToDevice::Identify,
            ToDevice::Ping => ToDevice::Ping,
            ToDevice::SelfTest => ToDevice::SelfTest,
            ToDevice::SyncTime { host_time_us } => ToDevice::SyncTime { host_time_us },
            ToDevice::Reset(into) => ToDevice::Reset(into),
            ToDevice::SetRate { rate } => ToDevice::SetRate { rate },
            ToDevice::SetExclusion(policy) => ToDevice::SetExclusion(policy),
            ToDevice::ModelBegin(begin) => ToDevice::ModelBegin(begin),
            ToDevice::ModelChunk(ModelChunk { offset, .. }) => {
                ToDevice::ModelChunk(ModelChunk { offset, bytes: &[] })
            }
            ToDevice::ModelEnd => ToDevice::ModelEnd,
            ToDevice::SetFeatures(filters) => {
                ToDevice::SetFeatures(FeatureFilters { weights: &[], ..filters })
            }
            ToDevice::SetImpedance { on } => ToDevice::SetImpedance { on },
        }
    }
}
