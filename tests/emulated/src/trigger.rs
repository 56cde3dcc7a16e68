//! Edges at the emulated trigger input, and the events that a board must send for them.

use link::{Event, EventKind};
use model::ADC_RATE_HZ;

/// Name of the file with the edges in the image's folder: microseconds after the first DRDY, 64
/// bits each, little endian.
pub const FILE: &str = "trigger.u64";

/// Smallest number of samples that last a whole number of microseconds: at 512 Hz, eight last 15
/// 625 us.
const SAMPLES: u64 = 8;
const SAMPLES_US: u64 = SAMPLES * 1_000_000 / ADC_RATE_HZ as u64;
const _: () = assert!((SAMPLES * 1_000_000).is_multiple_of(ADC_RATE_HZ as u64));

/// Number of samples from one group of edges to the next: 104, a fifth of a second. It is not a
/// multiple of the 64 samples of a window, so successive groups fall at different places in the
/// window.
const GROUP_PERIOD: u64 = 13 * SAMPLES;

/// Number of groups from one burst to the next.
const BURST_PERIOD: u64 = 40;

/// Edges of a burst: more than the 16 that the board can keep
/// (`firmware::deadlines::EVENTS_WAITING`).
const BURST_EDGES: usize = 24;

/// Smallest number of events that a board must send for a burst. Its queue holds 16, of which the
/// events of the three edges around the preceding DRDY may take three, because they wait while the
/// encoder is busy.
const BURST_KEPT: usize = 13;

/// Time between the edges of a burst in microseconds. The whole burst is between two DRDYs.
const BOUNCE_US: usize = 20;

/// Edges of the trigger input, rising and falling in turn.
#[derive(Debug, Default)]
pub struct Edges {
    /// Times in microseconds after the first DRDY.
    pub at_us: Vec<u64>,
    /// Index in `at_us` of the first edge of each burst.
    bursts: Vec<usize>,
}

impl Edges {
    /// Creates edges for `samples` samples. The first edge is at the first DRDY, the second 100 us
    /// later. Groups of edges follow: 1 us before a DRDY, at that DRDY, 1 us after it, and in the
    /// middle between two later DRDYs. In some groups, a burst replaces the last edge.
    pub fn new(samples: usize) -> Self {
        let mut at_us = vec![0, 100];
        let mut bursts = Vec::new();
        for group in 1..(samples as u64 / GROUP_PERIOD) {
            let drdy = group * GROUP_PERIOD / SAMPLES * SAMPLES_US;
            at_us.extend([drdy - 1, drdy, drdy + 1]);
            if group % BURST_PERIOD == BURST_PERIOD / 2 {
                bursts.push(at_us.len());
                let burst = (drdy + 200..).step_by(BOUNCE_US);
                at_us.extend(burst.take(BURST_EDGES));
            } else {
                at_us.push(drdy + 5 * SAMPLES_US / (2 * SAMPLES));
            }
        }
        Self { at_us, bursts }
    }

    /// Returns the events that a board must send if its first DRDY was at `origin_us`, with their
    /// device times in microseconds.
    ///
    /// The sample of an event is the first whose DRDY is at or after the edge. Edges are close to
    /// DRDYs only where the time of the DRDY is a whole number of microseconds, so rounding does
    /// not change the sample.
    pub fn events(&self, origin_us: u64) -> Vec<(u64, Event)> {
        let kinds = [EventKind::TriggerRise, EventKind::TriggerFall].into_iter();
        let edges = (0..).zip(&self.at_us).zip(kinds.cycle());
        let events = edges.map(|((number, at_us), kind)| {
            let event = Event {
                kind,
                number,
                sample: (at_us * u64::from(ADC_RATE_HZ)).div_ceil(1_000_000),
            };
            (origin_us + at_us, event)
        });
        events.collect()
    }

    /// Returns whether the events of the edges `lost`, indices in `at_us`, may be missing. Each
    /// burst must lose at least one event, but no more than the board's queue cannot hold; no other
    /// event may be missing.
    pub fn may_lack(&self, lost: &[usize]) -> bool {
        let in_burst = |first: &usize| {
            let burst = *first..first + BURST_EDGES;
            lost.iter().filter(|number| burst.contains(number)).count()
        };
        let in_bursts: Vec<usize> = self.bursts.iter().map(in_burst).collect();
        let right = 1..=BURST_EDGES - BURST_KEPT;
        in_bursts.iter().all(|count| right.contains(count))
            && in_bursts.iter().sum::<usize>() == lost.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_before_at_and_after_samples_and_some_in_bursts_that_do_not_fit() {
        let edges = Edges::new(10_000);
        assert!(edges.at_us.is_sorted_by(|a, b| a < b));
        let events = edges.events(0).into_iter().take(6);
        // Sample 0 for the edge at the first DRDY, 1 for the edge 100 us later. Then the group at
        // sample 104: 104 for the edges before and at its DRDY, 105 for the edge after it, 107 for
        // the edge in the middle between two DRDYs.
        let samples: Vec<u64> = events.map(|(_, event)| event.sample).collect();
        assert_eq!(samples, [0, 1, 104, 104, 105, 107]);
        assert_eq!(edges.bursts.len(), 2);
    }

    #[test]
    fn only_edges_of_bursts_may_be_lost_and_not_all_of_them() {
        let edges = Edges::new(10_000);
        let [first, second] = edges.bursts[..] else {
            panic!("{:?}", edges.bursts);
        };
        assert!(edges.may_lack(&[first + 13, second, second + 23]));
        assert!(!edges.may_lack(&[]), "no burst was too long");
        assert!(!edges.may_lack(&[11, first, second]), "there was room");
        let many: Vec<usize> = (first..first + 12).chain([second]).collect();
        assert!(!edges.may_lack(&many), "there was room");
    }
}
