//! Orders from the session to the acquisition.

use link::{ResetInto, Streams};
use pipeline::Mains;

/// Parameters of a run: the time from one `Start` to the next, or to a `Stop`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Run {
    /// Number of the start since boot, 1 for the first; wraps. Distinguishes outputs of this run
    /// from queued ones of an earlier run.
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

/// Effect of a command on the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Start the run at sample 0.
    Start(Run),
    /// Stop streaming and discard samples until the next start.
    Stop,
    /// Test the converters; report the result with
    /// [`Session::send_self_test`](crate::Session::send_self_test).
    SelfTest,
    /// Restart the board, after a tenth of a second in which waiting frames can be sent.
    Reset(ResetInto),
}
