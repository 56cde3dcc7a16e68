//! The log of a bad link: at most one line a minute.

/// Shortest time between two lines, microseconds.
const PERIOD_US: i64 = 60_000_000;

/// What a bad link has damaged or lost since the last line of the log.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LinkLog {
    logged_us: Option<i64>,
    damaged: u64,
    missing: u64,
}

impl LinkLog {
    /// Adds damaged frames.
    pub(crate) fn add_damaged(&mut self, frames: u32) {
        self.damaged = self.damaged.saturating_add(frames.into());
    }

    /// Adds missing codes, samples, steps or events.
    pub(crate) fn add_missing(&mut self, count: u64) {
        self.missing = self.missing.saturating_add(count);
    }

    /// Returns the next line if one is due at `now_us`, and starts counting again.
    pub(crate) fn next_line(&mut self, now_us: i64) -> Option<String> {
        let is_due = self
            .logged_us
            .is_none_or(|last_us| now_us - last_us >= PERIOD_US);
        if !is_due || (self.damaged == 0 && self.missing == 0) {
            return None;
        }
        let LinkLog {
            damaged, missing, ..
        } = *self;
        *self = LinkLog {
            logged_us: Some(now_us),
            ..LinkLog::default()
        };
        Some(format!(
            "bad link: {damaged} frames damaged, {missing} codes, blocks, samples or events missing since \
             the last such line; check cable, connectors and --baud"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::{LinkLog, PERIOD_US};

    #[test]
    fn a_minute_of_losses_is_one_line_with_their_sum() {
        let mut log = LinkLog::default();
        assert_eq!(log.next_line(0), None);
        log.add_damaged(3);
        assert!(
            log.next_line(5)
                .unwrap()
                .contains("3 frames damaged, 0 codes")
        );
        for second in 1..60 {
            log.add_missing(2);
            assert_eq!(log.next_line(second * 1_000_000), None);
        }
        let line = log.next_line(PERIOD_US + 5).unwrap();
        assert!(line.contains("0 frames damaged, 118 codes"), "{line}");
        assert_eq!(log.next_line(3 * PERIOD_US), None);
    }
}
