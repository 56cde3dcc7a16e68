//! Arguments of the host's commands, and the answers to them.

use serde::{Deserialize, Serialize};

/// Arguments of `Start`, which starts the streams and sets the indices of windows and samples to 0.
///
/// A `Start` with the streams and the mains frequency that are already active is acknowledged and
/// changes nothing, so a host can repeat a `Start` until the acknowledgement arrives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Start {
    /// Streams to send; unknown bits are refused with `BadArgument`.
    pub streams: Streams,
    /// Mains frequency of the notch, 50 or 60 Hz; 0 keeps the active one. Any other value is
    /// refused with `BadArgument`.
    pub mains_hz: u8,
}

/// The host's decisions about the exclusion of bad electrodes: argument of `SetExclusion`. In both
/// bit sets, bit n is electrode n of [`Capabilities::labels`](crate::Capabilities::labels).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExclusionPolicy {
    /// Electrodes that are always excluded.
    pub always: u64,
    /// Electrodes that are never excluded, except electrodes in `always`.
    pub never: u64,
    /// Whether the device itself finds bad electrodes and excludes them.
    pub automatic: bool,
}

impl ExclusionPolicy {
    /// Policy of a device until its host sets another: the device finds bad electrodes itself.
    pub const AUTOMATIC: Self = Self { always: 0, never: 0, automatic: true };
}

bit_set! {
    /// Set of streams, one bit for each.
    pub struct Streams {
        /// Bit 0: one [`Code`](crate::Code) per hop.
        const CODES = 0;
        /// Bit 1: every ADC sample, in [`Raw`](crate::Raw).
        const RAW = 1;
        /// Bit 2: every filtered step, in [`Filtered`](crate::Filtered).
        const FILTERED = 2;
        /// Bit 3: every ten seconds the planes of a window with its code, in
        /// [`Audit`](crate::Audit).
        const AUDIT = 3;
        /// Bit 4: edges at the device's inputs, in [`Event`](crate::Event).
        const EVENTS = 4;
        /// Bit 5: every ADC sample, compressed without loss, in
        /// [`CompressedRaw`](crate::CompressedRaw).
        const COMPRESSED_RAW = 5;
        /// Bit 6: one [`PackedCode`](crate::PackedCode) per hop.
        const PACKED = 6;
        /// Bit 7: one [`Features`](crate::Features) per hop, if the host has set filters.
        const FEATURES = 7;
    }
}

impl Streams {
    /// Every stream that this version names.
    pub const ALL: Streams = Streams(0b1111_1111);

    /// Returns this set minus the streams of `other`.
    #[must_use]
    pub const fn without(self, other: Streams) -> Streams {
        Streams(self.0 & !other.0)
    }
}

byte_enum! {
    /// Program that a `Reset` starts; one byte on the wire.
    pub enum ResetInto {
        /// 0: the application, restarted.
        Firmware = 0,
        /// 1: the microcontroller's built-in boot loader, which accepts new firmware over USB.
        Bootloader = 1,
        _ => "Any other: refused with `BadArgument`.",
    }
}

/// Answer to a command; a device sends exactly one per command received.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ack {
    /// `seq` of the command's frame.
    pub of: u32,
    /// Outcome of the command: done, or the reason why not.
    pub result: AckResult,
}

byte_enum! {
    /// Outcome of a command; one byte on the wire.
    pub enum AckResult {
        /// 0: the device has executed the command, or has accepted it (`SelfTest`, `Reset`).
        Done = 0,
        /// 1: the firmware is older than the host and does not know the command.
        UnknownCommand = 1,
        /// 2: an argument is out of range.
        BadArgument = 2,
        /// 3: not possible now; the same command can succeed later.
        Busy = 3,
        /// 4: the command is known, but this board or model cannot do it.
        NotSupported = 4,
        /// 5: the device tried and failed: an uploaded model is not sound.
        Failed = 5,
        _ => "Any other: a result newer than this host; the command was not executed.",
    }
}

/// Answer to `SyncTime`, sent before the `Ack` of that command.
///
/// The answer carries two of the four times of a round trip. Its header has the third, the time of
/// the answer itself; the host records the fourth, the arrival of the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClockReading {
    /// The host's time, repeated from the command, microseconds.
    pub host_time_us: u64,
    /// Time at which the device read the command, microseconds since boot.
    pub received_us: u64,
}
