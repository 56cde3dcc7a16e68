//! The next row of a topic, and the stamps with which a recorder places events at the right rows.

use neuro_ros::{NeuroFrame, Stamp};

use crate::time::HostTime;

/// Largest number of ADC samples by which an event can lag the next row: 8 s at 512 Hz. Messages
/// arrive in the order in which the device made them, so an event further behind belongs to a run
/// whose start the bridge has not noticed yet.
const MOST_BEHIND: f64 = 4096.0;

/// The next row that the bridge will publish on a topic. A row is a code, an ADC sample or a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NextRow {
    /// Number of rows published on the topic so far.
    pub(crate) index: u64,
    /// ADC sample, counted since `Start`, that was taken when the row was at the electrodes. It has
    /// a fraction where filters delay the row, and is negative for a row before the present run.
    pub(crate) sample: f64,
    pub(crate) samples_per_row: f64,
}

impl NextRow {
    /// Returns the row at which a recording has an event that happened directly before ADC sample
    /// `sample`, or together with it: the first row after the previous ADC sample.
    pub(crate) fn row_of(self, sample: u64) -> u64 {
        #[expect(clippy::cast_precision_loss, reason = "below 2^53 (500,000 years)")]
        let ahead = sample as f64 - 1.0 - self.sample;
        if ahead < -MOST_BEHIND {
            return self.index;
        }
        // Add more than the rounding error, so that `floor` does not turn an exact number of rows
        // into the number below.
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let rows = (ahead / self.samples_per_row + 1e-6).floor() as i64;
        self.index.saturating_add_signed(rows.saturating_add(1))
    }
}

/// Start of a recording by `rosneuro_recorder`: the first frame that it takes, and when.
///
/// The recorder writes every frame. It places an event at the row (stamp of the event - start) *
/// rate. The start is the arrival of the first frame minus the frame's duration. The rate is stated
/// in the frames, and is never exactly the rate of the device's clock. A stamp that places an event
/// at a given row therefore follows from the number of rows since the start, not from the time of
/// the row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordingStart {
    /// Number of rows that were published on the topic before the recording's first row.
    first_row: u64,
    /// Time that the recorder assumes for its first row, nanoseconds since 1970.
    start_ns: i64,
    rate_hz: u16,
}

impl RecordingStart {
    /// Returns the start of a recording whose first frame is `frame`, published at `now`. Frames of
    /// a topic are numbered from 1 without a gap.
    pub fn new(frame: &NeuroFrame, now: HostTime) -> RecordingStart {
        let rows = frame.eeg.info.nsamples;
        let rate_hz = frame.sr.max(1);
        let frames = frame.neuroheader.seq.saturating_sub(1);
        RecordingStart {
            first_row: u64::from(frames) * u64::from(rows),
            start_ns: now.wall_ns - i64::from(rows) * 1_000_000_000 / i64::from(rate_hz),
            rate_hz,
        }
    }

    /// Returns the stamp with which the recorder places an event at row `row`, or at its own first
    /// row if `row` comes before that.
    ///
    /// The stamp is 1.5 rows later than the row. The recorder's library, libxdffileio, counts rows
    /// from 0, but GDF and its readers count from 1: one row corrects this. The library also rounds
    /// down: with the half row, the result is still right if the first frame arrives up to half a
    /// row after its publication.
    pub fn stamp(&self, row: u64) -> Stamp {
        let half_rows = 2 * i128::from(row.saturating_sub(self.first_row)) + 3;
        let since_ns = half_rows * 500_000_000 / i128::from(self.rate_hz);
        let since_ns = i64::try_from(since_ns).unwrap_or(i64::MAX);
        Stamp::from_nanoseconds(self.start_ns.saturating_add(since_ns))
    }
}
