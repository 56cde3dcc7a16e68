//! Finds pauses of the acquisition: times in which it made no samples and lost no frame.
//!
//! After a standstill the next frame comes late. If it waited in a buffer, the frames behind it
//! follow faster than they were made, until the buffer is empty. If the acquisition paused, the
//! frames come at their normal pace, all equally late. So the arrival of the second frame shows
//! which of the two happened.

/// A frame ends a standstill if its delay, relative to the frame before it, exceeds this time,
/// microseconds. A busy PC delays single frames by less.
const LEAST_STANDSTILL_US: i64 = 250_000;

/// Arrival of the newest frame, and how late it was after a standstill.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pauses {
    newest_us: Option<i64>,
    /// Delay of the newest frame, microseconds, while frames that may have waited in a buffer
    /// arrive; otherwise 0.
    late_us: i64,
}

/// What the arrival of a frame reveals about pauses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Finding {
    /// The acquisition paused: before the frame that has been waiting since the standstill, or, if
    /// no frame waits, before this frame.
    pub(crate) is_pause: bool,
    /// The frame ends a standstill. The next frame shows whether the standstill was a pause.
    pub(crate) is_open: bool,
}

impl Pauses {
    /// Notes a frame that arrives at `read_us`. `span_us` is the duration of its samples and of the
    /// samples of the lost frames before it. Both times are in microseconds.
    pub(crate) fn record(&mut self, read_us: i64, span_us: i64) -> Finding {
        let interval_us = read_us - self.newest_us.replace(read_us).unwrap_or(read_us - span_us);
        let excess_us = interval_us - span_us;
        let is_open = excess_us > LEAST_STANDSTILL_US;
        let late_us = self.late_us + excess_us;
        let was_late = self.late_us > 0;
        let is_buffer_empty = late_us < LEAST_STANDSTILL_US / 2;
        let is_pause = was_late && !is_buffer_empty && interval_us >= span_us / 2;
        self.late_us = if is_open {
            excess_us
        } else if is_pause || !was_late || is_buffer_empty {
            0
        } else {
            late_us
        };
        Finding { is_pause, is_open }
    }
}
