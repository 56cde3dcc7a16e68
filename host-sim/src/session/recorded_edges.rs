//! Trigger edges that mark the events of a recording.

use std::collections::VecDeque;

use link::EventKind;
use recordings::Onsets;

/// Longest duration of a pulse, from its rising to its falling edge, microseconds.
const LONGEST_PULSE_US: u64 = 10_000;

/// Shortest time between two rising edges, microseconds. An event that follows sooner shares the
/// pulse of the event before it.
const SHORTEST_PERIOD_US: u64 = 2_000;

/// Edges of a trigger input that has a pulse at the start of each event of a recording. A pulse
/// lasts 10 ms, or half the time to the next pulse if that is shorter.
#[derive(Clone, Debug, Default)]
pub struct RecordedEdges {
    /// Edges that [`Self::take_due`] has not returned yet: time in the signal, microseconds, and
    /// direction.
    edges: VecDeque<(u64, EventKind)>,
}

/// A trigger edge that is due, because it precedes a sample or coincides with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DueEdge {
    pub(crate) kind: EventKind,
    /// Time by which the edge precedes the sample, microseconds.
    pub(crate) early_us: u64,
}

impl RecordedEdges {
    /// Creates a pulse of two edges at the start of each event of a recording with `samples`
    /// samples of the ADC. An edge after the last sample, which no sample could carry, is moved to
    /// the last sample.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "not negative; beyond 2^64 us it saturates"
    )]
    pub fn new(onsets: &Onsets, samples: u64) -> Self {
        let last = samples.saturating_sub(1);
        let last_us = last * 1_000_000 / u64::from(model::ADC_RATE_HZ);
        let mut rises: Vec<u64> = Vec::new();
        for onset in &onsets.seconds {
            let rise = ((onset * 1e6).round() as u64).min(last_us);
            if rises.last().is_none_or(|last| rise - last >= SHORTEST_PERIOD_US) {
                rises.push(rise);
            }
        }
        let mut edges = VecDeque::new();
        for (number, &rise) in rises.iter().enumerate() {
            let next = rises.get(number + 1);
            let pulse = next.map_or(LONGEST_PULSE_US, |next| (next - rise) / 2);
            edges.push_back((rise, EventKind::TriggerRise));
            let fall = rise + pulse.min(LONGEST_PULSE_US);
            edges.push_back((fall.min(last_us), EventKind::TriggerFall));
        }
        Self { edges }
    }

    /// Returns the number of pulses that are left.
    pub fn pulses(&self) -> usize {
        self.edges.len().div_ceil(2)
    }

    /// Removes and returns the next edge if it is not after the sample at `signal_us`, the sample's
    /// time in the signal in microseconds, rounded down. Edge times are rounded to the nearest
    /// microsecond, so an edge at the sample itself can be a microsecond later.
    pub(crate) fn take_due(&mut self, signal_us: u64) -> Option<DueEdge> {
        let (at_us, kind) = self.edges.pop_front_if(|(at_us, _)| *at_us <= signal_us + 1)?;
        Some(DueEdge { kind, early_us: signal_us.saturating_sub(at_us) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_event_has_a_pulse_that_ends_before_the_next_one() {
        let onsets =
            Onsets { seconds: vec![0.0, 1.0, 1.0, 1.001, 1.008], outside: 0, ..Onsets::default() };
        let mut edges = RecordedEdges::new(&onsets, 1_000);
        assert_eq!(edges.pulses(), 3);
        assert_eq!(edges.take_due(0).map(|edge| edge.kind), Some(EventKind::TriggerRise));
        assert_eq!(edges.take_due(9_998), None);
        let early = |edge: Option<DueEdge>| edge.map(|edge| (edge.kind, edge.early_us));
        assert_eq!(early(edges.take_due(11_000)), Some((EventKind::TriggerFall, 1_000)));
        let left: Vec<_> = std::iter::from_fn(|| early(edges.take_due(2_000_000))).collect();
        assert_eq!(
            left,
            [
                (EventKind::TriggerRise, 1_000_000),
                (EventKind::TriggerFall, 996_000),
                (EventKind::TriggerRise, 992_000),
                (EventKind::TriggerFall, 982_000),
            ]
        );
    }
}
