//! A self-test of the converters that the user asks for while the bridge runs.

use link::{AckResult, ToDevice};

use crate::query::refusal_of_self_test;

/// Longest time until the result arrives, microseconds.
const TIMEOUT_US: i64 = 15_000_000;

/// How far a self-test has come. Its result is not a part of it.
#[derive(Clone, Debug, Default)]
pub(crate) enum SelfTestState {
    #[default]
    NotWanted,
    /// The device is told, for the first time at the host time `since_us`, microseconds.
    Due { since_us: Option<i64> },
    /// The device tests its converters.
    Running { since_us: i64 },
    /// There is no result, for a reason that is worded for the user.
    Failed(String),
}

impl SelfTestState {
    /// Returns the command that is due.
    pub(crate) fn command(&self) -> Option<ToDevice<'static>> {
        matches!(self, SelfTestState::Due { .. }).then_some(ToDevice::SelfTest)
    }

    /// Returns whether a result belongs to this self-test.
    pub(crate) fn is_underway(&self) -> bool {
        matches!(
            self,
            SelfTestState::Due { .. } | SelfTestState::Running { .. }
        )
    }

    /// Records the time, after which the result may be overdue.
    pub(crate) fn tick(&mut self, now_us: i64) {
        let since_us = match self {
            SelfTestState::Due { since_us } => *since_us.get_or_insert(now_us),
            SelfTestState::Running { since_us } => *since_us,
            SelfTestState::NotWanted | SelfTestState::Failed(_) => return,
        };
        if now_us - since_us > TIMEOUT_US {
            let why =
                "the device has sent no result within 15 s; check cable and power, and try again";
            *self = SelfTestState::Failed(why.to_owned());
        }
    }

    /// Records the acknowledgement of the command.
    pub(crate) fn acknowledge(&mut self, result: AckResult, now_us: i64) {
        *self = match result {
            // A busy device is at it: the acknowledgement of an earlier command was lost.
            AckResult::Done | AckResult::Busy => SelfTestState::Running { since_us: now_us },
            result => SelfTestState::Failed(refusal_of_self_test(result)),
        };
    }

    /// Records that the device has restarted or left.
    pub(crate) fn interrupt(&mut self, why: &str) {
        if self.is_underway() {
            *self = SelfTestState::Failed(format!("{why} during its self-test; try again"));
        }
    }
}
