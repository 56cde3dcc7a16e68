//! The messages of each direction.

use serde::{Deserialize, Serialize};

use crate::{
    Ack, Audit, Capabilities, ClockReading, Code, Converters, Event, Filtered, Hello, Quality, Raw,
    ResetInto, SelfTest, Start, Stats, Timing,
};

/// A message that can be framed: one enum per direction.
pub trait Message<'a>: Serialize + Deserialize<'a> {
    /// Messages that this version knows; a larger number on the wire is a newer message.
    const KINDS: u32;
    /// Goes into the CRC before the header and is never sent, so that no frame passes for one of
    /// the other direction: an echo on a looped line is refused as damaged, and nobody answers it.
    const DIRECTION: u8;
}

/// From device to host. Grows only at its end; the number of a message is its place here.
#[expect(
    clippy::large_enum_variant,
    reason = "no heap in no_std; a decoder holds one message at a time, about 1 KB"
)]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToHost<'a> {
    /// 0: who the device is.
    #[serde(borrow)]
    Hello(Hello<'a>),
    /// 1: what it measures and how its codes are to be read.
    #[serde(borrow)]
    Capabilities(Capabilities<'a>),
    /// 2: one code.
    Code(Code),
    /// 3: what it has counted.
    Stats(Stats),
    /// 4: the answer to a command.
    Ack(Ack),
    /// 5: what each electrode delivered within one second.
    Quality(Quality),
    /// 6: how long its stages took.
    Timing(Timing),
    /// 7: the ADC's samples as they came.
    #[serde(borrow)]
    Raw(Raw<'a>),
    /// 8: what the filters made of them.
    #[serde(borrow)]
    Filtered(Filtered<'a>),
    /// 9: a window together with its code.
    #[serde(borrow)]
    Audit(Audit<'a>),
    /// 10: what happened at an input.
    Event(Event),
    /// 11: how the converters are.
    Converters(Converters),
    /// 12: what the device found out about its converters.
    SelfTest(SelfTest),
    /// 13: the device's clock beside the host's.
    ClockReading(ClockReading),
}

impl<'a> Message<'a> for ToHost<'a> {
    const KINDS: u32 = 14;
    const DIRECTION: u8 = b'H';
}

/// From host to device. Grows only at its end; the number of a message is its place here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ToDevice {
    /// 0: begin streaming.
    Start(Start),
    /// 1: end streaming.
    Stop,
    /// 2: answer with `Hello` and `Capabilities`.
    Identify,
    /// 3: answer with the `Ack` alone; tells a live link from a dead one.
    Ping,
    /// 4: try the converters with their own signals; nothing may stream. `SelfTest` follows.
    SelfTest,
    /// 5: answer with a `ClockReading`.
    SyncTime {
        /// The host's clock, microseconds; given back as it is.
        host_time_us: u64,
    },
    /// 6: start anew, a tenth of a second after the `Ack`.
    Reset(ResetInto),
}

impl Message<'_> for ToDevice {
    const KINDS: u32 = 7;
    const DIRECTION: u8 = b'D';
}
