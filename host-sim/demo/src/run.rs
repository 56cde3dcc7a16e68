//! Messages that the subscriber received during one run.

use std::time::{Duration, Instant};

use link::Flags;
use neuro_ros::NeuroFrame;

/// One message from the bridge, with the time at which it arrived.
#[derive(Debug, Clone)]
pub(crate) struct Received {
    pub(crate) arrival: Instant,
    pub(crate) frame: NeuroFrame,
}

impl Received {
    /// Returns the index of the code's window, 0 for the first of the stream.
    pub(crate) fn window(&self) -> usize {
        let window = self.word("seq_lo") | self.word("seq_hi") << 16;
        usize::try_from(window).unwrap_or(usize::MAX)
    }

    /// Returns the device time of the code's last sample.
    fn device_time(&self) -> Duration {
        let us = self.word("t_us_0") | self.word("t_us_1") << 16 | self.word("t_us_2") << 32;
        Duration::from_micros(us)
    }

    /// Returns whether `flag` is set in the message's status words. [`Flags::FILLER`] marks a
    /// message that the bridge sent in place of a lost code.
    pub(crate) fn has(&self, flag: Flags) -> bool {
        self.word("flags") & u64::from(flag.bits()) != 0
    }

    /// Returns the status word with this label, 16 bits; 0 if the frame has no such word.
    fn word(&self, label: &str) -> u64 {
        let tri = &self.frame.tri;
        let place = tri.info.labels.iter().position(|name| name == label);
        let word = place.and_then(|place| tri.data.get(place));
        word.and_then(|word| u64::try_from(*word).ok()).unwrap_or(0)
    }
}

/// Messages of one run in the order of their arrival.
#[derive(Debug, Clone, Default)]
pub(crate) struct Run {
    /// Messages that arrived on `/encoded`.
    pub(crate) codes: Vec<Received>,
    /// Messages that arrived on `/neurodata_reconstructed`.
    pub(crate) reconstructed: Vec<Received>,
    /// Number of codes that the board made, as its report states.
    pub(crate) made: usize,
}

impl Run {
    /// Returns the messages that carry a code, in order; fillers, which replace lost codes, are
    /// left out.
    fn without_fillers(&self) -> impl Iterator<Item = &Received> {
        self.codes.iter().filter(|code| !code.has(Flags::FILLER))
    }

    /// Returns the number of codes that arrived at the subscriber; fillers are not counted.
    pub(crate) fn received(&self) -> usize {
        self.without_fillers().count()
    }

    /// Returns the number of codes that the board made but that did not arrive.
    pub(crate) fn lost(&self) -> usize {
        self.made.saturating_sub(self.received())
    }

    /// Returns the times between the arrivals of successive messages on `/encoded`, fillers
    /// included, ms.
    pub(crate) fn arrival_intervals_ms(&self) -> Vec<f64> {
        let intervals = self.codes.windows(2).map(|pair| pair[1].arrival - pair[0].arrival);
        intervals.map(milliseconds).collect()
    }

    /// Returns the differences between the device times of successive received codes, ms; fillers
    /// are left out.
    pub(crate) fn device_intervals_ms(&self) -> Vec<f64> {
        let times: Vec<Duration> = self.without_fillers().map(Received::device_time).collect();
        let intervals = times.windows(2).map(|pair| pair[1].saturating_sub(pair[0]));
        intervals.map(milliseconds).collect()
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn received(flags: Flags, window: i32, time: [i32; 3]) -> Received {
        let labels = ["flags", "seq_lo", "seq_hi", "t_us_0", "t_us_1", "t_us_2"];
        let words = [flags.bits().into(), window, 1, time[0], time[1], time[2]];
        let mut frame = NeuroFrame::default();
        frame.tri.info.labels = labels.map(str::to_owned).into();
        frame.tri.data = words.into();
        let arrival = Instant::now();
        Received { arrival, frame }
    }

    #[test]
    fn made_is_received_plus_lost_and_a_filler_counts_as_lost() {
        let run = Run {
            codes: vec![
                received(Flags::SETTLING, 7, [0xFFFF, 0, 1]),
                received(Flags::FILLER, 8, [0; 3]),
                received(Flags::CLIPPED, 9, [0xF447, 1, 1]),
            ],
            made: 4,
            ..Run::default()
        };
        assert_eq!([run.received(), run.lost()], [2, 2]);
        assert_eq!(run.codes[0].window(), 0x1_0007);
        let intervals = run.device_intervals_ms();
        assert!(intervals.len() == 1 && (intervals[0] - 62.536).abs() < 1e-9, "{intervals:?}");
    }
}
