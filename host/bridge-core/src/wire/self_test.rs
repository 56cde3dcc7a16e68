//! A self-test of the converters that the user asks for while the bridge runs.

use link::{AckResult, ToDevice};

use crate::query::refusal_of_self_test;

/// Time limit for the result, microseconds.
const TIMEOUT_US: i64 = 15_000_000;

/// Progress of a self-test. The session stores the result.
#[derive(Clone, Debug, Default)]
pub(crate) enum SelfTestState {
    #[default]
    NotWanted,
    /// The command is due, since the host time `since_us`, microseconds; `None` before the first
    /// tick.
    Due { since_us: Option<i64> },
    /// The device tests its converters.
    Running { since_us: i64 },
    /// There is no result, for a reason that is worded for the user.
    Failed(String),
}

impl SelfTestState {
    /// Returns the self-test command if it must be sent.
    pub(crate) fn command(&self) -> Option<ToDevice<'static>> {
        matches!(self, SelfTestState::Due { .. }).then_some(ToDevice::SelfTest)
    }

    /// Returns whether the self-test is due or running, so that an arriving result belongs to it.
    pub(crate) fn is_underway(&self) -> bool {
        matches!(self, SelfTestState::Due { .. } | SelfTestState::Running { .. })
    }

    /// Ends the self-test as failed if its result is overdue at `now_us`.
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

    /// Handles the acknowledgement of the self-test command: waits for the result if the device
    /// runs the test, otherwise stores why the device refuses it.
    pub(crate) fn acknowledge(&mut self, result: AckResult, now_us: i64) {
        *self = match result {
            // A busy device is already testing: the acknowledgement of an earlier command was lost.
            AckResult::Done | AckResult::Busy => SelfTestState::Running { since_us: now_us },
            result => SelfTestState::Failed(refusal_of_self_test(result)),
        };
    }

    /// Ends a self-test that is due or running as failed, for the reason `why`, such as a restart
    /// of the device.
    pub(crate) fn interrupt(&mut self, why: &str) {
        if self.is_underway() {
            *self = SelfTestState::Failed(format!("{why} during its self-test; try again"));
        }
    }
}
