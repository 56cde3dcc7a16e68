//! Edges at the emulated trigger input, and the events that came of them.

use std::fmt;

use link::{Event, EventKind, ToHost};
use model::ADC_RATE_HZ;
use serde::Serialize;

use super::frames;

/// The file in QEMU's folder that the image reads.
pub(super) const FILE: &str = "trigger.u64";

/// Samples in whole microseconds: at 512 Hz, eight last 15,625 us.
const SAMPLES: u64 = 8;
const SAMPLES_US: u64 = SAMPLES * 1_000_000 / ADC_RATE_HZ as u64;
const _: () = assert!((SAMPLES * 1_000_000).is_multiple_of(ADC_RATE_HZ as u64));

/// Samples from one group of edges to the next: a fifth of a second, and another part of a window each
/// time.
const APART: u64 = 13 * SAMPLES;

/// Edges of a burst: more than the board keeps, 16 (`firmware::deadlines::EVENTS_WAITING`), less the
/// three around the DRDY before, where the encoder is busy.
const BURST: u64 = 24;
const KEPT: usize = 13;
/// From edge to edge within it, microseconds: all of them between two samples.
const BOUNCE_US: u64 = 20;

/// Every so many groups there is a burst.
const BETWEEN_BURSTS: u64 = 40;

/// The input's edges for so many samples, rising and falling in turn, microseconds behind the first
/// DRDY: at the first one, between the first two, and then in groups at a DRDY, right before and right
/// after it, and in the middle between two, and now and then a burst.
pub(super) fn edges(samples: usize) -> Vec<u64> {
    let mut edges = vec![0, 100];
    for group in 1..(samples as u64 / APART) {
        let drdy = group * APART / SAMPLES * SAMPLES_US;
        edges.extend([drdy - 1, drdy, drdy + 1]);
        let middle = drdy + 5 * SAMPLES_US / (2 * SAMPLES);
        if is_burst(group) {
            edges.extend((0..BURST).map(|edge| drdy + 200 + edge * BOUNCE_US));
        } else {
            edges.push(middle);
        }
    }
    edges
}

/// Whether there is a burst after this group's DRDY.
fn is_burst(group: u64) -> bool {
    group % BETWEEN_BURSTS == BETWEEN_BURSTS / 2
}

/// First sample whose DRDY is not before so many microseconds behind the first one's. DRDYs that are
/// not a whole number of microseconds apart are no edge's neighbour.
fn sample_of(edge: u64) -> u64 {
    (edge * u64::from(ADC_RATE_HZ)).div_ceil(1_000_000)
}

/// What came of the edges.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Triggers {
    edges: usize,
    events: usize,
    /// Gaps in the numbers; all of them within bursts.
    lost: usize,
    #[serde(skip)]
    pub(super) faults: Vec<String>,
}

impl Triggers {
    /// Holds the events that were sent against the edges.
    pub(super) fn new(sent: &[u8], edges: &[u64]) -> Self {
        let mut events = Vec::new();
        frames::each(sent, |header, message| {
            if let ToHost::Event(event) = message {
                events.push((header.device_time_us, *event));
            }
        });
        let mut faults = Vec::new();
        // The device's time at the first DRDY, by the first event.
        let origin = events.first().map(|(at_us, event)| {
            let edge = edges.get(event.number as usize);
            at_us.wrapping_sub(edge.copied().unwrap_or(0))
        });
        for (at_us, event) in &events {
            if let Some(why) = wrong(*at_us, event, edges, origin.unwrap_or(0)) {
                faults.push(format!("event {}: {why}", event.number));
            }
        }
        if !events.is_sorted_by(|(_, before), (_, after)| before.number < after.number) {
            faults.push("events that are not in order".to_owned());
        }
        let came = |number: usize| {
            events
                .iter()
                .any(|(_, event)| event.number as usize == number)
        };
        let lost: Vec<usize> = (0..edges.len()).filter(|number| !came(*number)).collect();
        let (in_bursts, alone): (Vec<usize>, _) =
            lost.iter().partition(|number| is_in_burst(edges, **number));
        for number in alone {
            faults.push(format!("event {number} is lost, which had room"));
        }
        let bouncing = (0..edges.len()).filter(|number| is_in_burst(edges, *number));
        let bouncing = bouncing.count();
        let bursts = bouncing / usize::try_from(BURST).unwrap_or(1);
        if in_bursts.len() < bursts || bouncing - in_bursts.len() < bursts * KEPT {
            let lost = in_bursts.len();
            faults.push(format!(
                "{lost} of {bouncing} events of {bursts} bursts are lost"
            ));
        }
        if events.is_empty() {
            faults.push("no event came".to_owned());
        }
        Self {
            edges: edges.len(),
            events: events.len(),
            lost: lost.len(),
            faults,
        }
    }
}

/// Why an event is not what happened; none where it is.
fn wrong(at_us: u64, event: &Event, edges: &[u64], origin: u64) -> Option<String> {
    let Some(&edge) = edges.get(event.number as usize) else {
        return Some("there was no such edge".to_owned());
    };
    let kind = if event.number.is_multiple_of(2) {
        EventKind::TriggerRise
    } else {
        EventKind::TriggerFall
    };
    let sample = sample_of(edge);
    if event.kind != kind {
        return Some(format!("{:?}, not {kind:?}", event.kind));
    }
    if at_us != origin.wrapping_add(edge) {
        return Some(format!("at {at_us} us, not {}", origin.wrapping_add(edge)));
    }
    (event.sample != sample).then(|| format!("at sample {}, not {sample}", event.sample))
}

/// Whether an edge has a neighbour as near as those of bursts.
fn is_in_burst(edges: &[u64], number: usize) -> bool {
    let is_near = |other: Option<usize>| {
        let other = other.and_then(|other| edges.get(other));
        other.is_some_and(|other| other.abs_diff(edges[number]) == BOUNCE_US)
    };
    is_near(number.checked_sub(1)) || is_near(number.checked_add(1))
}

impl fmt::Display for Triggers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "trigger input: {} edges, {} events at their microsecond and sample, {} lost within bursts \
             and gaps in the numbers",
            self.edges, self.events, self.lost
        )
    }
}

#[cfg(test)]
mod tests {
    use link::{Encoder, MAX_FRAME};

    use super::*;

    const ORIGIN: u64 = 4_321;

    /// What a sound board sends: of each burst, the first ones.
    fn events(edges: &[u64]) -> Vec<(u64, Event)> {
        let mut events = Vec::new();
        let mut waiting = 0;
        for (number, edge) in edges.iter().enumerate() {
            waiting = if is_in_burst(edges, number) {
                waiting + 1
            } else {
                0
            };
            if waiting <= KEPT {
                let kinds = [EventKind::TriggerRise, EventKind::TriggerFall];
                events.push((
                    ORIGIN + edge,
                    Event {
                        kind: kinds[number % 2],
                        number: u32::try_from(number).expect("few"),
                        sample: sample_of(*edge),
                    },
                ));
            }
        }
        events
    }

    fn faults(change: impl FnOnce(&mut Vec<(u64, Event)>)) -> String {
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
        Triggers::new(&sent, &edges).faults.join("; ")
    }

    #[test]
    fn an_event_with_another_time_sample_or_kind_and_one_that_is_missing_are_named() {
        assert_eq!(faults(|_| ()), "");
        assert!(faults(|events| events[7].0 += 1).starts_with("event 7: at "));
        let wrong = faults(|events| events[9].1.sample += 1);
        assert!(wrong.starts_with("event 9: at sample "), "{wrong}");
        let wrong = faults(|events| events[4].1.kind = EventKind::TriggerFall);
        assert_eq!(wrong, "event 4: TriggerFall, not TriggerRise");
        let wrong = faults(|events| events.retain(|(_, event)| event.number != 11));
        assert_eq!(wrong, "event 11 is lost, which had room");
        assert!(faults(|events| events.swap(3, 4)).contains("not in order"));
        assert!(faults(Vec::clear).contains("no event came"));
    }

    #[test]
    fn edges_lie_at_before_and_after_samples_and_some_in_bursts_that_do_not_fit() {
        let edges = edges(10_000);
        assert!(edges.is_sorted_by(|a, b| a < b));
        let samples: Vec<u64> = edges.iter().map(|edge| sample_of(*edge)).collect();
        // The first DRDY, the one after; then right before, at, right after and between.
        assert_eq!(samples[..6], [0, 1, 104, 104, 105, 107]);
        let in_burst = (0..edges.len()).filter(|number| is_in_burst(&edges, *number));
        assert_eq!(in_burst.count() as u64, 2 * BURST);
    }
}
