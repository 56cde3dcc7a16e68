//! A `Start` that the device refused.

use link::{AckResult, ToDevice};

use crate::wire::words;

/// Delay before a refused `Start` is sent again, microseconds.
const RETRY_US: i64 = 10_000_000;

/// A refused `Start` after which no choice of fewer streams is left to try.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RefusedStart {
    command: ToDevice,
    result: AckResult,
    /// Host time of the refusal, microseconds.
    refused_us: i64,
}

impl RefusedStart {
    pub(crate) fn new(command: ToDevice, result: AckResult, refused_us: i64) -> RefusedStart {
        RefusedStart {
            command,
            result,
            refused_us,
        }
    }

    /// Returns whether it is too early to send `Start` again.
    pub(crate) fn is_recent(&self, now_us: i64) -> bool {
        now_us < self.refused_us + RETRY_US
    }

    /// Returns why the device refused, and what to do.
    pub(crate) fn reason(&self) -> String {
        words::refusal(&self.command, self.result)
    }
}
