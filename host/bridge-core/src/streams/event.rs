//! Events on `/events/bus`: trigger edges, lost data, electrode contact, restarts, refused devices.

use std::collections::VecDeque;

use link::{Event, EventKind};
use neuro_ros::{NeuroEvent, Stamp};

use crate::core::{Effects, EventPlace};
use crate::streams::ledger::{Arrival, Ledger};
use crate::streams::stamps::Reception;

/// Converts edges of the trigger input to events on `/events/bus`, and counts lost edges.
#[derive(Debug, Default)]
pub(crate) struct EventStream {
    pub(crate) ledger: Ledger,
    /// Number of received events whose kind this bridge does not know.
    pub(crate) unknown: u64,
    /// Number of lost events at the last report to `/diagnostics`.
    reported: u64,
}

impl EventStream {
    /// Accepts any event number next: while no stream is active, the device numbers events but does
    /// not send them.
    pub(crate) fn restart(&mut self) {
        self.ledger.expect_any();
    }

    /// Returns the number of events that were lost since the last call.
    pub(crate) fn lost_since_report(&mut self) -> u64 {
        let reported = std::mem::replace(&mut self.reported, self.ledger.lost);
        self.ledger.lost - reported
    }

    /// Publishes an event that happened at `reception.device_us`, at row `row` of the announced
    /// stream, and returns the trigger's new level. If `device_us` is `None`, the stamp is the time
    /// at which the event was read.
    ///
    /// Returns `None`, and publishes nothing, if the event's number is old or its kind unknown.
    pub(crate) fn receive(
        &mut self,
        event: Event,
        reception: Reception<'_>,
        row: Option<u64>,
        bus: &mut EventBus,
        effects: &mut dyn Effects,
    ) -> Option<u16> {
        let Arrival::New { lost } = self.ledger.record(event.number) else {
            return None;
        };
        let place = EventPlace { row, device_us: reception.device_us };
        let device_us = reception.device_us.map(i128::from);
        let time = device_us.and_then(|us| reception.clock.wall_ns(us));
        let wall_ns = time.unwrap_or(reception.read.wall_ns);
        if lost > 0 {
            tracing::debug!(lost, before = event.number, "events lost");
            bus.publish(&BusEvent::EdgesLost(lost), wall_ns, place, effects);
        }
        let (edge, level) = match event.kind {
            EventKind::TriggerRise => (BusEvent::TriggerHigh, 1),
            EventKind::TriggerFall => (BusEvent::TriggerLow, 0),
            EventKind::Newer(kind) => {
                if self.unknown == 0 {
                    tracing::warn!(
                        kind,
                        "the device sends events of a newer kind, which are not published"
                    );
                }
                self.unknown += 1;
                return None;
            }
        };
        bus.publish(&edge, wall_ns, place, effects);
        Some(level)
    }
}

/// Number of newest edges that are stored. A level is looked up for a sample that is usually at
/// most one frame, 62.5 ms, old, and 256 edges are not expected in this time.
const MAX_EDGES: usize = 256;

/// Level of the trigger input at each ADC sample, reconstructed from the received edges.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trigger {
    /// Level of the trigger input before the oldest edge in `edges`.
    level_before: u16,
    edges: VecDeque<Edge>,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    sample: u64,
    level: u16,
}

impl Trigger {
    /// Records an edge: the trigger has the level `level` from ADC sample `sample` on.
    pub(crate) fn record_edge(&mut self, sample: u64, level: u16) {
        if self.edges.len() == MAX_EDGES
            && let Some(oldest) = self.edges.pop_front()
        {
            self.level_before = oldest.level;
        }
        self.edges.push_back(Edge { sample, level });
    }

    /// Discards all edges, because sample indices start at 0 again; the current level stays.
    pub(crate) fn restart(&mut self) {
        if let Some(newest) = self.edges.back() {
            self.level_before = newest.level;
        }
        self.edges.clear();
    }

    /// Returns the trigger level, 0 or 1, at the ADC sample with index `sample` since `Start`.
    /// Before a run's first edge, this is the level at the end of the previous run, initially 0.
    pub(crate) fn level_at(&self, sample: u64) -> u16 {
        let newest = self.edges.iter().rev().find(|edge| edge.sample <= sample);
        newest.map_or(self.level_before, |edge| edge.level)
    }
}

/// An event on the bus, with its data.
///
/// The project has defined the GDF codes for lost data, lost edges, refused devices and excluded
/// electrodes. They lie outside GDF's user codes (1 to 255), which belong to the experiment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum BusEvent {
    /// Rising edge of the trigger input.
    TriggerHigh,
    /// Falling edge of the trigger input.
    TriggerLow,
    /// Electrodes have lost contact. Holds the labels of all electrodes without contact.
    ElectrodesOff(Vec<String>),
    /// All electrodes have regained contact.
    ElectrodesOn,
    /// The device has changed which electrodes it excludes; it computes their signals from the
    /// others. Holds the labels of all excluded electrodes; empty if none is excluded any more.
    ElectrodesExcluded(Vec<String>),
    /// The user has marked this moment. Holds the user's text.
    Marker(String),
    /// The device made data that the bridge did not receive. Holds the duration, in seconds.
    DataLost(f32),
    /// The bridge did not receive some edges of the trigger input. Holds the number of these edges.
    EdgesLost(u32),
    /// Another device was connected, and its codes cannot be published. Holds the reason.
    DeviceRefused(String),
    /// The device restarted, or another device was connected for some time. Holds the duration
    /// without data, in seconds.
    DeviceRestarted(f32),
}

impl BusEvent {
    /// Returns the event's code: from GDF's table of events, or one that the project has defined.
    fn code(&self) -> i32 {
        match self {
            BusEvent::TriggerHigh => NeuroEvent::trigger_edge(true).0,
            BusEvent::TriggerLow => NeuroEvent::trigger_edge(false).0,
            // GDF's table of events names this code "artifact, failing electrode".
            BusEvent::ElectrodesOff(_) => 0x0105,
            BusEvent::ElectrodesOn => 0x0105 | NeuroEvent::END,
            BusEvent::ElectrodesExcluded(labels) if labels.is_empty() => 0x7f04 | NeuroEvent::END,
            BusEvent::ElectrodesExcluded(_) => 0x7f04,
            BusEvent::Marker(_) => NeuroEvent::MARKER,
            BusEvent::DataLost(_) => 0x7f01,
            BusEvent::EdgesLost(_) => 0x7f02,
            BusEvent::DeviceRefused(_) => 0x7f03,
            // GDF's table of events names this code "start of a new segment, after a break".
            BusEvent::DeviceRestarted(_) => 0x7ffe,
        }
    }

    /// Returns the duration of the event in seconds; 0 if it has none.
    fn duration_s(&self) -> f32 {
        match self {
            BusEvent::DataLost(seconds) | BusEvent::DeviceRestarted(seconds) => *seconds,
            _ => 0.0,
        }
    }

    fn description(&self) -> String {
        match self {
            BusEvent::TriggerHigh => NeuroEvent::trigger_edge(true).1.to_owned(),
            BusEvent::TriggerLow => NeuroEvent::trigger_edge(false).1.to_owned(),
            BusEvent::ElectrodesOff(labels) => format!("electrodes off: {}", labels.join(" ")),
            BusEvent::ElectrodesOn => "electrodes have contact".to_owned(),
            BusEvent::ElectrodesExcluded(labels) if labels.is_empty() => {
                "no electrode excluded".to_owned()
            }
            BusEvent::ElectrodesExcluded(labels) => {
                format!("electrodes excluded: {}", labels.join(" "))
            }
            BusEvent::Marker(text) => text.clone(),
            BusEvent::DataLost(seconds) => format!("data lost: {seconds:.3} s"),
            BusEvent::EdgesLost(edges) => format!("trigger edges lost: {edges}"),
            BusEvent::DeviceRefused(why) => format!("device refused: {why}"),
            BusEvent::DeviceRestarted(seconds) => format!("device restarted: {seconds:.3} s"),
        }
    }
}

/// Publishes events, numbers them, and moves their stamps by the delay of the announced stream.
#[derive(Debug)]
pub(crate) struct EventBus {
    message: NeuroEvent,
    /// Whether events are published, because the user asked for them.
    enabled: bool,
    /// Time that is added to the stamp of every event, microseconds.
    shift_us: i64,
}

impl EventBus {
    pub(crate) fn new(enabled: bool) -> EventBus {
        EventBus { message: NeuroEvent::on_bus(), enabled, shift_us: 0 }
    }

    pub(crate) fn set_shift(&mut self, shift_us: i64) {
        self.shift_us = shift_us;
    }

    /// Returns by how much the stamps of events are later than the events, microseconds.
    pub(crate) fn shift_us(&self) -> i64 {
        self.shift_us
    }

    /// Publishes an event that happened at the wall-clock time `wall_ns`, nanoseconds since 1970,
    /// and at `place`. Returns whether events are published.
    pub(crate) fn publish(
        &mut self,
        event: &BusEvent,
        wall_ns: i64,
        place: EventPlace,
        effects: &mut dyn Effects,
    ) -> bool {
        if !self.enabled {
            return false;
        }
        let message = &mut self.message;
        let stamp_ns = wall_ns.saturating_add(self.shift_us.saturating_mul(1000));
        message.header.stamp = Stamp::from_nanoseconds(stamp_ns);
        message.neuroheader.seq = message.neuroheader.seq.wrapping_add(1);
        message.header.seq = message.neuroheader.seq;
        message.event = event.code();
        message.duration = event.duration_s();
        message.description = event.description();
        effects.publish_event(message, place);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::{MAX_EDGES, Trigger};

    #[test]
    fn the_level_changes_at_the_sample_of_its_edge() {
        let mut trigger = Trigger::default();
        trigger.record_edge(10, 1);
        trigger.record_edge(20, 0);
        assert_eq!([9, 10, 19, 20].map(|sample| trigger.level_at(sample)), [0, 1, 1, 0]);
    }

    #[test]
    fn the_level_survives_a_restart_and_discarded_edges() {
        let mut trigger = Trigger::default();
        trigger.record_edge(10, 1);
        trigger.restart();
        assert_eq!(trigger.level_at(0), 1);
        for edge in 0..=MAX_EDGES as u64 {
            trigger.record_edge(100 + edge, 0);
        }
        assert_eq!((trigger.level_at(100), trigger.edges.len()), (0, MAX_EDGES));
    }
}
