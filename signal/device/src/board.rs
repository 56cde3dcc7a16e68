//! What a session needs from its board: identity, abilities, and the execution of orders.

use link::{ExclusionPolicy, ResetCause, ResetInto, Streams};
use pipeline::{Mains, Rate};

/// Identity of the device, constant from its start to its next reset.
#[derive(Clone, Debug)]
pub struct Identity<'i> {
    /// Version of the firmware, at most [`link::MAX_TEXT_BYTES`] bytes.
    pub firmware: &'i str,
    /// Name of the board, at most [`link::MAX_TEXT_BYTES`] bytes.
    pub board: &'i str,
    /// Unique id of the microcontroller, 96 bits.
    pub chip_uid: [u8; 12],
    /// Number that differs from boot to boot: a random number, or a count of boots.
    pub session_id: u32,
    /// Cause of the last reset, from the microcontroller's reset flags or from the fault record
    /// that survives a reset.
    pub reset_cause: ResetCause,
    /// Description of a fault that was found at this start, or that caused the last reset; at most
    /// [`link::MAX_TEXT_BYTES`] bytes, empty without a fault.
    pub fault: &'i str,
}

/// Commands and streams that a board supports; the session refuses all others.
#[expect(clippy::struct_excessive_bools, reason = "each of them can be true with any other")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Streams that a `Start` can request.
    pub streams: Streams,
    /// True if the board's converters can test themselves with their internal signals.
    pub self_test: bool,
    /// True if the board can start the boot loader that is built into its microcontroller.
    pub bootloader: bool,
    /// True if device time comes from a clock, which the host can query. Without a clock, device
    /// time advances with the samples, so a reading would tell the host nothing about delays.
    pub clock: bool,
    /// True if the board's converters can measure the impedance of the electrodes.
    pub impedance: bool,
}

impl Abilities {
    /// Abilities of a board that streams codes and supports no optional command.
    pub const CODES: Self = Self {
        streams: Streams::CODES,
        self_test: false,
        bootloader: false,
        clock: false,
        impedance: false,
    };
}

/// Parameters of a run, which lasts from one `Start` to the next `Start` or `Stop`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Run {
    /// Number of the run since boot, from 1; wraps. Distinguishes outputs of this run from outputs
    /// of an earlier run that are still queued.
    pub number: u32,
    /// Mains frequency, which the notch filter removes.
    pub mains: Mains,
    /// Streams that the host requested.
    pub streams: Streams,
}

impl Run {
    /// Value before the first start: run 0 without streams.
    pub const NONE: Self = Self { number: 0, mains: Mains::Hz50, streams: Streams::empty() };
}

/// Action that a command from the host requires of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Start this run; its first sample has index 0.
    Start(Run),
    /// Stop streaming and measuring impedances, and discard samples until the next start.
    Stop,
    /// Test the converters; report the result with
    /// [`Session::send_self_test`](crate::Session::send_self_test).
    SelfTest,
    /// Use this quantiser rate for the packed code from now on; see
    /// [`Producer::set_rate`](crate::Producer::set_rate).
    SetRate(Rate),
    /// Exclude electrodes by this policy from now on; see
    /// [`Producer::set_exclusion`](crate::Producer::set_exclusion).
    SetExclusion(ExclusionPolicy),
    /// Switch the excitation of the electrodes on or off, and report its state in
    /// [`AcquiredSample::excited`](crate::AcquiredSample::excited).
    SetImpedance(bool),
    /// Restart the board 0.1 s later, so that queued frames can still be sent.
    Reset(ResetInto),
}
