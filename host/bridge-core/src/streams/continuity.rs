//! Time between the last item of one run of the device and the first item of the next.

/// Place of a topic's newest item on the host's clock. It survives a restart of the device, whose own
/// clock starts at 0 again, and so shows how many items are missing between two runs.
///
/// "Item" means a code, a packed block, an ADC sample or a filtered step.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Continuity {
    /// Host time of the newest item, microseconds; `None` before the first item of a recording.
    newest_us: Option<f64>,
    /// Whether the device has restarted after the newest item.
    run_ended: bool,
    /// Time by which the items since the last restart are later than their places in the topic,
    /// microseconds: what rounding to whole items has left over. It is part of the next gap, so
    /// restarts never add up to more than half an item.
    left_over_us: f64,
}

impl Continuity {
    /// Records the host time of an item that is published, microseconds.
    pub(crate) fn record(&mut self, host_us: f64) {
        self.newest_us = Some(host_us);
    }

    /// Records that the device has restarted: the next item belongs to another run.
    pub(crate) fn end_run(&mut self) {
        self.run_ended = self.newest_us.is_some();
    }

    /// Returns the number of items between the newest one and the first of the next run, which is at
    /// the host time `first_us`. Items follow each other every `period_us` microseconds. Returns 0
    /// within a run.
    pub(crate) fn missing_before(&mut self, first_us: f64, period_us: f64) -> u64 {
        let (Some(newest_us), true) = (self.newest_us, self.run_ended) else {
            return 0;
        };
        self.run_ended = false;
        let gap_us = first_us - newest_us + self.left_over_us;
        let periods = (gap_us / period_us).round().max(1.0);
        // A device that seems to be back before it left has a clock that cannot be trusted.
        self.left_over_us = (gap_us - periods * period_us).max(-period_us);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at least 0, and saturates"
        )]
        let missing = (periods - 1.0) as u64;
        missing
    }
}

/// A stretch of missing data in a topic, all of which is filled or skipped at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MissingStretch {
    /// Device time at which the stretch was at the electrodes, microseconds.
    pub(crate) start_us: i128,
    pub(crate) seconds: f32,
    /// Whether the device restarted in this time.
    pub(crate) restarted: bool,
}

#[cfg(test)]
mod tests {
    use super::Continuity;

    #[test]
    fn items_between_two_runs_are_counted_and_rounding_does_not_add_up() {
        let mut continuity = Continuity::default();
        continuity.end_run();
        assert_eq!(continuity.missing_before(5e6, 62_500.0), 0, "no run before");
        let (mut now_us, mut items) = (0.0, 0);
        continuity.record(now_us);
        for _ in 0..1000 {
            continuity.end_run();
            // 2.4 items pass, of which the last is the first of the next run.
            now_us += 2.4 * 62_500.0;
            items += continuity.missing_before(now_us, 62_500.0) + 1;
            assert_eq!(
                continuity.missing_before(now_us, 62_500.0),
                0,
                "asked twice"
            );
            continuity.record(now_us);
        }
        assert_eq!(items, 2400);
    }

    #[test]
    fn a_run_that_starts_before_the_last_one_ended_has_no_gap() {
        let mut continuity = Continuity::default();
        continuity.record(10e6);
        continuity.end_run();
        assert_eq!(continuity.missing_before(4e6, 1000.0), 0);
        continuity.record(4e6);
        continuity.end_run();
        assert_eq!(continuity.missing_before(4e6 + 11_000.0, 1000.0), 9);
    }
}
