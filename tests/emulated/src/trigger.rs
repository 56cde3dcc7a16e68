//! Edges at the emulated trigger input, and the events that a board sends for them.

use link::{Event, EventKind, ToHost};
use model::ADC_RATE_HZ;
use serde::Serialize;

use crate::frames;

/// File of the edges in the image's folder: microseconds after the first DRDY, 64 bits, little endian.
pub const FILE: &str = "trigger.u64";

/// Number of samples that last a whole number of microseconds: at 512 Hz, eight last 15 625 us.
const SAMPLES: u64 = 8;
const SAMPLES_US: u64 = SAMPLES * 1_000_000 / ADC_RATE_HZ as u64;
const _: () = assert!((SAMPLES * 1_000_000).is_multiple_of(ADC_RATE_HZ as u64));

/// Number of samples from one group of edges to the next: a fifth of a second. It is chosen so that
/// each group falls on a different part of the window.
const GROUP_PERIOD: u64 = 13 * SAMPLES;

/// Groups from one burst to the next.
const BURST_PERIOD: u64 = 40;

/// Edges of a burst: more than the 16 that the board can keep (`firmware::deadlines::EVENTS_WAITING`).
const BURST_EDGES: u64 = 24;

/// Least number of events from a burst: 16, less the three for the edges around the preceding DRDY,
/// which wait while the encoder is busy.
const BURST_KEPT: usize = 13;

/// Time between the edges of a burst in microseconds; all of them are between two samples.
const BOUNCE_US: u64 = 20;

/// Edges of the trigger input for `samples` samples, rising and falling in turn, in microseconds
/// after the first DRDY. One edge is at the first DRDY and one between the first two. Then follow
/// groups with an edge right before a DRDY, one at it, one right after it, and one in the middle
/// between two DRDYs or a burst in its place.
pub fn edges(samples: usize) -> Vec<u64> {
    let mut edges = vec![0, 100];
    for group in 1..(samples as u64 / GROUP_PERIOD) {
        let drdy = group * GROUP_PERIOD / SAMPLES * SAMPLES_US;
        edges.extend([drdy - 1, drdy, drdy + 1]);
        if group % BURST_PERIOD == BURST_PERIOD / 2 {
            edges.extend((0..BURST_EDGES).map(|edge| drdy + 200 + edge * BOUNCE_US));
        } else {
            edges.push(drdy + 5 * SAMPLES_US / (2 * SAMPLES));
        }
    }
    edges
}

/// Index of the first sample whose DRDY is not before an edge. A DRDY between two whole microseconds has no edge next
/// to it, so rounding is irrelevant.
fn sample_of(edge: u64) -> u64 {
    (edge * u64::from(ADC_RATE_HZ)).div_ceil(1_000_000)
}

/// Returns whether a neighbouring edge is [`BOUNCE_US`] away, which is the case only in a burst.
fn is_in_burst(edges: &[u64], number: usize) -> bool {
    let is_near = |other: Option<usize>| {
        let other = other.and_then(|other| edges.get(other));
        other.is_some_and(|other| other.abs_diff(edges[number]) == BOUNCE_US)
    };
    is_near(number.checked_sub(1)) || is_near(number.checked_add(1))
}

/// Events of a run, and the edges that caused them.
#[derive(Debug, Clone)]
pub struct Triggers {
    edges: Vec<u64>,
    /// Events with their device times in microseconds.
    events: Vec<(u64, Event)>,
}

/// Figures of a run: number of edges at the input, of events received, and of edges without an
/// event.
#[derive(Debug, Clone, Serialize)]
pub struct Counts {
    edges: usize,
    events: usize,
    lost: usize,
}

impl Triggers {
    /// Collects the events from the bytes that a board has sent.
    pub fn new(sent: &[u8], edges: Vec<u64>) -> Self {
        let mut events = Vec::new();
        frames::for_each(sent, |header, message| {
            if let ToHost::Event(event) = message {
                events.push((header.device_time_us, *event));
            }
        });
        Self { edges, events }
    }

    /// Counts edges, events, and edges without an event.
    pub fn counts(&self) -> Counts {
        Counts {
            edges: self.edges.len(),
            events: self.events.len(),
            lost: self.lost().len(),
        }
    }

    /// Indices of the edges without an event.
    fn lost(&self) -> Vec<usize> {
        let came = |number: usize| {
            let mut events = self.events.iter();
            events.any(|(_, event)| event.number as usize == number)
        };
        let numbers = 0..self.edges.len();
        numbers.filter(|number| !came(*number)).collect()
    }

    /// Checks that each event has its edge's kind, time and sample, and that events are lost only
    /// in bursts, after the board's queue is full.
    ///
    /// # Panics
    /// Names the first event that is wrong or lost.
    pub fn assert_right(&self) {
        let edges = &self.edges;
        let (first_us, first) = self.events.first().expect("no event came");
        let edge_of = |event: &Event| {
            let edge = edges.get(event.number as usize).copied();
            edge.unwrap_or_else(|| panic!("event {}: there was no such edge", event.number))
        };
        // Device time of the first DRDY.
        let origin = first_us.wrapping_sub(edge_of(first));
        for (at_us, event) in &self.events {
            let (number, edge) = (event.number, edge_of(event));
            let kind = [EventKind::TriggerRise, EventKind::TriggerFall][number as usize % 2];
            assert_eq!(event.kind, kind, "kind of event {number}");
            let due_us = origin.wrapping_add(edge);
            assert_eq!(*at_us, due_us, "time of event {number} in us");
            assert_eq!(event.sample, sample_of(edge), "sample of event {number}");
        }
        let numbers = self.events.iter().map(|(_, event)| event.number);
        assert!(
            numbers.is_sorted_by(|before, after| before < after),
            "events are not in order"
        );
        let lost = self.lost();
        let alone = lost.iter().find(|number| !is_in_burst(edges, **number));
        assert_eq!(alone, None, "an event is lost for which there was room");
        let numbers = 0..edges.len();
        let in_bursts = numbers.filter(|number| is_in_burst(edges, *number)).count();
        let bursts = in_bursts / usize::try_from(BURST_EDGES).expect("a small number");
        assert!(
            lost.len() >= bursts && in_bursts - lost.len() >= bursts * BURST_KEPT,
            "{} of {in_bursts} events of {bursts} bursts are lost",
            lost.len()
        );
    }
}

#[cfg(test)]
mod tests {
    use link::{Encoder, MAX_FRAME};

    use super::*;
    use crate::refusal;

    const ORIGIN_US: u64 = 4_321;

    /// Events of a correct board: of each burst, the first ones.
    fn events(edges: &[u64]) -> Vec<(u64, Event)> {
        let mut events = Vec::new();
        let mut waiting = 0;
        for (number, edge) in edges.iter().enumerate() {
            waiting = if is_in_burst(edges, number) {
                waiting + 1
            } else {
                0
            };
            if waiting <= BURST_KEPT {
                let event = Event {
                    kind: [EventKind::TriggerRise, EventKind::TriggerFall][number % 2],
                    number: u32::try_from(number).expect("few"),
                    sample: sample_of(*edge),
                };
                events.push((ORIGIN_US + edge, event));
            }
        }
        events
    }

    fn check(change: impl FnOnce(&mut Vec<(u64, Event)>)) {
        let edges = edges(10_000);
        let mut events = events(&edges);
        change(&mut events);
        let mut encoder = Encoder::default();
        let mut sent = Vec::new();
        for (at_us, event) in events {
            let mut buffer = [0; MAX_FRAME];
            let frame = encoder.encode(at_us, &ToHost::Event(event), &mut buffer);
            sent.extend(frame.expect("a frame"));
        }
        Triggers::new(&sent, edges).assert_right();
    }

    fn assert_refused(words: &str, change: impl FnOnce(&mut Vec<(u64, Event)>)) {
        refusal::assert_refused(words, || check(change));
    }

    #[test]
    fn an_event_with_another_time_sample_or_kind_and_one_that_is_missing_are_refused() {
        check(|_| ());
        assert_refused("time of event 7 in us", |events| events[7].0 += 1);
        assert_refused("sample of event 9", |events| events[9].1.sample += 1);
        assert_refused("TriggerFall\n right: TriggerRise", |events| {
            events[4].1.kind = EventKind::TriggerFall;
        });
        assert_refused("which there was room\n  left: Some(11)", |events| {
            events.retain(|(_, event)| event.number != 11);
        });
        assert_refused("not in order", |events| events.swap(3, 4));
        assert_refused("no event came", Vec::clear);
    }

    #[test]
    fn edges_are_before_at_and_after_samples_and_some_in_bursts_that_do_not_fit() {
        let edges = edges(10_000);
        assert!(edges.is_sorted_by(|a, b| a < b));
        let samples: Vec<u64> = edges.iter().map(|edge| sample_of(*edge)).collect();
        // The first DRDY and the one after it; then the group: right before a DRDY, at it, right
        // after it, between.
        assert_eq!(samples[..6], [0, 1, 104, 104, 105, 107]);
        let in_burst = (0..edges.len()).filter(|number| is_in_burst(&edges, *number));
        assert_eq!(in_burst.count() as u64, 2 * BURST_EDGES);
    }
}
