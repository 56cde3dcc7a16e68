//! Orders from the session to the acquisition.

use link::{ResetInto, Streams};
use pipeline::{Mains, Rate};

/// Parameters of a run, which lasts from one `Start` to the next `Start` or `Stop`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Run {
    /// Number of the run since boot, from 1; wraps. Distinguishes outputs of this run from those of
    /// an earlier run that are still queued.
    pub number: u32,
    /// Mains frequency, which the notch filter removes.
    pub mains: Mains,
    /// Streams that the host requested.
    pub streams: Streams,
}

impl Run {
    /// Placeholder before the first start: no streams.
    pub const NONE: Self = Self {
        number: 0,
        mains: Mains::Hz50,
        streams: Streams::empty(),
    };
}

/// Action that a command from the host requires of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Start this run; its first sample has index 0.
    Start(Run),
    /// Stop streaming and discard samples until the next start.
    Stop,
    /// Test the converters; report the result with
    /// [`Session::send_self_test`](crate::Session::send_self_test).
    SelfTest,
    /// Make blocks of the packed code at this rate from now on; see [`Producer::set_rate`](crate::Producer::set_rate).
    SetRate(Rate),
    /// Restart the board 0.1 s later, so that queued frames can still be sent.
    Reset(ResetInto),
}
