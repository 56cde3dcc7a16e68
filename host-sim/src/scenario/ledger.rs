//! Compares everything that the bridge's core publishes with what the board made.

use std::rc::Rc;

use bridge_core::{Effects, EventPlace, HostTime, TimedPackedBlock};
use neuro_ros::{DiagnosticArray, NeuroEvent, NeuroFrame, Stamp};

use super::topic::Topic;
use super::truth::{Content, Made, TopicKind, Values};

/// Flag of a filler, a row that replaces a missing one: bit 15 of the row's first status word.
const FILLER: u16 = 1 << 15;

/// Error of a time stamp, before the line's shortest delay is subtracted.
#[derive(Clone, Copy, Debug)]
pub(super) struct StampError {
    pub(super) error_us: f64,
    pub(super) at_us: f64,
    pub(super) is_settled: bool,
    pub(super) is_event: bool,
}

/// Record of everything published so far. It is also the core's [`Effects`]: it stores the core's
/// commands until the rehearsal sends them.
#[derive(Debug)]
pub(super) struct Ledger {
    pub(super) topics: [Topic; 4],
    /// Commands that are not yet sent to the board, one frame each.
    pub(super) commands: Vec<Vec<u8>>,
    /// The frame that the core handles now, and the time at which its bytes were read.
    frame: Option<Rc<Made>>,
    now: HostTime,
    /// Wall clock at host time 0 plus the sum of its steps so far, nanoseconds.
    wall_ns: i64,
    /// Host time from which time stamps count as settled, microseconds.
    settled_us: f64,
    settle_us: f64,
    /// Newest stamp of each topic, nanoseconds.
    stamps: [i64; 4],
    pub(super) errors: Vec<StampError>,
    /// Shortest time from the newest sample of a frame until the host reads the frame,
    /// microseconds.
    pub(super) shortest_us: f64,
    pub(super) edges: u64,
    pub(super) wrong_edges: u64,
    /// Ends of the faults after which no row has been published yet, microseconds.
    recovering: Vec<f64>,
    /// Longest recovery: its duration, and the time at which the fault ended, microseconds.
    pub(super) longest_recovery: (f64, f64),
    pub(super) diagnostics: DiagnosticArray,
}

impl Ledger {
    pub(super) fn new(wall_ns: i64, settle_s: f64) -> Self {
        Self {
            topics: TopicKind::ALL.map(TopicKind::topic),
            commands: Vec::new(),
            frame: None,
            now: HostTime { monotonic_us: 0, wall_ns },
            wall_ns,
            settled_us: settle_s * 1e6,
            settle_us: settle_s * 1e6,
            stamps: [0; 4],
            errors: Vec::new(),
            shortest_us: f64::INFINITY,
            edges: 0,
            wrong_edges: 0,
            recovering: Vec::new(),
            longest_recovery: (0.0, 0.0),
            diagnostics: DiagnosticArray::default(),
        }
    }

    /// Returns the readings of the host's clocks at the host time `us`, microseconds.
    #[expect(clippy::cast_possible_truncation, reason = "below 2^63 us")]
    pub(super) fn host_time(&self, us: f64) -> HostTime {
        HostTime { monotonic_us: us as i64, wall_ns: self.wall_ns + (us * 1e3) as i64 }
    }

    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    pub(super) fn step_wall_clock(&mut self, step_s: f64, now_us: f64) {
        self.wall_ns = self.wall_ns.saturating_add((step_s * 1e9) as i64);
        if step_s < -30.0 {
            // Stamps may decrease if the wall clock steps back by more than 30 s.
            self.stamps = [i64::MIN; 4];
        }
        self.unsettle(now_us);
    }

    /// Marks the next stamps as unsettled, because the fit of the board's clock begins again.
    pub(super) fn unsettle(&mut self, now_us: f64) {
        self.settled_us = self.settled_us.max(now_us + self.settle_us);
    }

    pub(super) fn record_fault_end(&mut self, now_us: f64) {
        self.recovering.push(now_us);
    }

    /// Returns the value `key` of the status whose name ends with `status` in the newest report to
    /// `/diagnostics`; 0 if there is no such value.
    pub(super) fn shown(&self, status: &str, key: &str) -> u64 {
        let mut statuses = self.diagnostics.status.iter();
        let status = statuses.find(|found| found.name.ends_with(status));
        let values = status.into_iter().flat_map(|status| &status.values);
        let mut values = values.filter(|value| value.key == key);
        let number = values.next().and_then(|value| value.value.parse().ok());
        number.unwrap_or_default()
    }

    /// Returns a sentence about the oldest fault after which no row was published; `None` if rows
    /// were published after every fault.
    pub(super) fn not_recovered(&self) -> Option<String> {
        let end_s = self.recovering.first()? / 1e6;
        Some(format!("nothing was published after the fault that ended at {end_s:.3} s"))
    }

    /// Records which frame the core handles next, and when its bytes were read.
    pub(super) fn handle(&mut self, frame: Option<Rc<Made>>, now: HostTime) {
        self.now = now;
        if let Some(Content::Rows(kind, rows)) = frame.as_ref().map(|made| &made.content) {
            self.topics[*kind as usize].record_arrived(rows);
        }
        if let Some(made) = &frame
            && matches!(made.content, Content::Rows(..))
        {
            self.shortest_us = self.shortest_us.min(self.now_us() - made.at_us);
        }
        self.frame = frame;
    }

    #[expect(clippy::cast_precision_loss, reason = "below 2^53 us (285 years)")]
    fn now_us(&self) -> f64 {
        self.now.monotonic_us as f64
    }

    /// Records the error of a stamp against the wall clock at `true_us`, the exact host time.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "a difference of seconds"
    )]
    fn record_stamp(&mut self, stamp: Stamp, true_us: f64, is_event: bool) {
        let true_ns = self.wall_ns + (true_us * 1e3) as i64;
        let at_us = self.now_us();
        self.errors.push(StampError {
            error_us: (stamp.nanoseconds() - true_ns) as f64 / 1e3,
            at_us,
            is_settled: at_us > self.settled_us,
            is_event,
        });
    }

    /// Compares the rows of a published frame with the rows that have arrived. Each row has its
    /// flags and its values, which are `None` for a filler without values.
    fn publish(&mut self, kind: TopicKind, stamp: Stamp, rows: Vec<(u16, Option<Values>)>) {
        let (now_us, number) = (self.now_us(), kind as usize);
        if stamp.nanoseconds() <= self.stamps[number] {
            let what = format!("at {:.3} s a stamp is not later than the one before", now_us / 1e6);
            self.topics[number].report_wrong(what);
        }
        self.stamps[number] = stamp.nanoseconds();
        for (index, (flags, values)) in rows.into_iter().enumerate() {
            let topic = &mut self.topics[number];
            let Some(values) = values.filter(|_| flags & FILLER == 0) else {
                topic.record_filler();
                if let Some(Content::Stats { run, next_window }) =
                    self.frame.as_ref().map(|f| &f.content)
                {
                    topic.record_stated(*run, (*next_window).into());
                }
                continue;
            };
            let Some(row) = topic.compare(&values, flags, now_us) else {
                continue;
            };
            if index == 0 {
                self.record_stamp(stamp, row.place.scalp_us, false);
            }
            for end_us in std::mem::take(&mut self.recovering) {
                if end_us > now_us {
                    self.recovering.push(end_us);
                } else if now_us - end_us > self.longest_recovery.0 {
                    self.longest_recovery = (now_us - end_us, end_us);
                }
            }
        }
    }

    fn publish_frame(&mut self, kind: TopicKind, frame: &NeuroFrame) {
        let (eeg, exg) = (&frame.eeg, &frame.exg);
        let width = usize::from(eeg.info.nchannels);
        let spare = usize::from(exg.info.nchannels);
        let words = frame.tri.data.chunks_exact(8).enumerate();
        let rows = words.map(|(row, words)| {
            let mut values = eeg.data[row * width..(row + 1) * width].to_vec();
            values.extend_from_slice(&exg.data[row * spare..(row + 1) * spare]);
            let flags = u16::try_from(words[0]).unwrap_or(u16::MAX);
            (flags, Some(Values::Numbers(values)))
        });
        self.publish(kind, frame.header.stamp, rows.collect());
    }
}

impl Effects for Ledger {
    fn send(&mut self, frame: &[u8]) {
        self.commands.push(frame.to_vec());
    }

    fn publish_encoded(&mut self, frame: &NeuroFrame) {
        self.publish_frame(TopicKind::Encoded, frame);
    }

    fn decode_block(&mut self, block: TimedPackedBlock) {
        let values = block.block.map(|block| Values::Packed(block.bytes, block.rate));
        self.publish(TopicKind::Packed, block.stamp, vec![(block.words.flags, values)]);
    }

    fn publish_raw(&mut self, frame: &NeuroFrame) {
        self.publish_frame(TopicKind::Raw, frame);
    }

    fn publish_filtered(&mut self, frame: &NeuroFrame) {
        self.publish_frame(TopicKind::Filtered, frame);
    }

    fn publish_event(&mut self, event: &NeuroEvent, _: EventPlace) {
        let edges = [false, true].map(|rises| NeuroEvent::trigger_edge(rises).0);
        let Some(rises) = edges.iter().position(|code| *code == event.event) else {
            return;
        };
        self.edges += 1;
        let frame = self.frame.as_ref();
        let edge = frame.filter(
            |made| matches!(made.content, Content::Edge { rises: edge } if edge == (rises == 1)),
        );
        match edge.map(|made| made.at_us) {
            Some(at_us) => self.record_stamp(event.header.stamp, at_us, true),
            None => self.wrong_edges += 1,
        }
        // Clear the frame: an edge is published once, so a second event from the same frame is an
        // error.
        self.frame = None;
    }
}
