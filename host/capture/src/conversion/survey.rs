//! The first pass over a recording: finds which streams it holds, and the row of each event.

use std::sync::Arc;

use neuro_ros::NeuroFrame;

use crate::conversion::block::{Block, STREAMS, Stream, TimedEvent};
use crate::conversion::collector::Listener;

/// Largest difference at which the times of an event and of a sample count as equal, microseconds.
/// The times of samples are rounded to microseconds.
const SAME_US: i64 = 2;

/// Longest time after a stream's last row at which an event is placed, seconds: a day. A later
/// event, as in a damaged recording, is placed at this limit.
const MAX_AFTER_END_S: u64 = 86_400;

/// Streams and events that the first pass over a recording has found.
#[derive(Debug, Default)]
pub(crate) struct Survey {
    pub(crate) streams: [StreamSurvey; STREAMS],
    pub(crate) events: Vec<TimedEvent>,
}

/// Length, shape and times of one stream.
#[derive(Debug, Default)]
pub(crate) struct StreamSurvey {
    pub(crate) rows: u64,
    /// The first frame, for its labels and its rate; `None` if the stream has no frame.
    pub(crate) first: Option<Arc<NeuroFrame>>,
    anchors: Vec<Anchor>,
}

/// Row and times at which a block begins, from which the row of an event is found.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    row: u64,
    run: u32,
    device_us: i64,
    wall_ns: i64,
}

impl Listener for Survey {
    const DECODES: bool = false;

    fn block(&mut self, block: Block) {
        let stream = &mut self.streams[block.stream as usize];
        stream.anchors.push(Anchor {
            row: stream.rows,
            run: block.run,
            device_us: block.first_us,
            wall_ns: block.wall_ns,
        });
        stream.rows += block.rows() as u64;
        stream.first.get_or_insert_with(|| Arc::new(block.frame));
    }

    fn event(&mut self, event: TimedEvent) {
        self.events.push(event);
    }
}

impl Survey {
    /// Returns the events, each with the index of its row in a stream, in the order of the rows.
    pub(crate) fn placed(&self, stream: Stream) -> Vec<(u64, &TimedEvent)> {
        let rows = &self.streams[stream as usize];
        let events = self.events.iter();
        let mut placed: Vec<_> = events.map(|event| (rows.row_of(event), event)).collect();
        placed.sort_by_key(|(row, _)| *row);
        placed
    }
}

impl StreamSurvey {
    /// Returns the wall clock at the first row, nanoseconds since 1970; 0 if there are no rows.
    pub(crate) fn start_ns(&self) -> i64 {
        self.anchors.first().map_or(0, |anchor| anchor.wall_ns)
    }

    /// Returns the duration of the signal by its rows, and by the host's clock, seconds, if the two
    /// differ by more than 1 s plus 1 %. No device has a clock as inexact as that.
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 rows")]
    pub(crate) fn differing_durations_s(&self) -> Option<(f64, f64)> {
        let (first, last) = (self.anchors.first()?, self.anchors.last()?);
        let rows_s = last.row as f64 / self.rate_hz() as f64;
        let host_s = last.wall_ns.saturating_sub(first.wall_ns) as f64 / 1e9;
        let differ = (rows_s - host_s).abs() > 1.0 + host_s.abs() / 100.0;
        differ.then_some((rows_s, host_s))
    }

    /// Returns the first row that happened at the same time as the event or later. For an event
    /// after the last row, returns the row that would have happened at its time.
    pub(crate) fn row_of(&self, event: &TimedEvent) -> u64 {
        let not_later = |anchor: &Anchor| {
            (anchor.run, anchor.device_us) <= (event.run, event.device_us.saturating_add(SAME_US))
        };
        let at = self.anchors.partition_point(not_later);
        let next = self.anchors.get(at);
        let before = self.anchors[..at].last().filter(|anchor| anchor.run == event.run);
        let Some(before) = before else {
            return next.map_or(self.rows, |next| next.row);
        };
        let later_us = event.device_us.saturating_sub(SAME_US);
        let later_us = later_us.saturating_sub(before.device_us);
        let mut row = before.row.saturating_add(self.rows_in(later_us));
        if let Some(next) = next
            && row > next.row
        {
            row = next.row;
            // The event lies between the device's last row and its restart. Only fillers are there,
            // and they have no device time, so the wall clock determines the row.
            if next.run != event.run {
                let fillers = &self.anchors[at..];
                let past = fillers.partition_point(|anchor| anchor.wall_ns < event.wall_ns);
                row = fillers.get(past).map_or(self.rows, |anchor| anchor.row);
            }
        }
        row.min(self.rows.saturating_add(MAX_AFTER_END_S * self.rate_hz()))
    }

    /// Returns the number of rows per second; 1 if the stream has no rows.
    fn rate_hz(&self) -> u64 {
        self.first.as_ref().map_or(1, |frame| frame.sr.max(1).into())
    }

    /// Returns the number of rows in `us` microseconds, rounded up.
    fn rows_in(&self, us: i64) -> u64 {
        let us = u64::try_from(us).unwrap_or(0);
        us.saturating_mul(self.rate_hz()).div_ceil(1_000_000)
    }
}
