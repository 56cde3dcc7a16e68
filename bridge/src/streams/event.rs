//! The stream of trigger events, published on `/events/bus`.

use link::{Event, EventKind};
use neuro_ros::{NeuroEvent, Stamp};

use crate::effects::Effects;
use crate::streams::ledger::{Arrival, Ledger};
use crate::streams::stamps::Reception;

/// Event code of a rising edge: the first user code of GDF's event table.
const TRIGGER_RISE: i32 = 0x0001;
/// Bit that marks the end of an event in GDF's event table and on ROS-Neuro's event bus, where it
/// is called OFF (32768).
const END_OF_EVENT: i32 = 0x8000;

/// Converts trigger edges to events on `/events/bus` and counts lost edges.
#[derive(Debug)]
pub(crate) struct EventStream {
    message: NeuroEvent,
    ledger: Ledger,
    /// Number of events of a kind that this bridge does not know.
    pub(crate) unknown: u64,
    /// Number of lost events at the last report to `/diagnostics`.
    reported: u64,
}

impl EventStream {
    pub(crate) fn new() -> EventStream {
        let mut message = NeuroEvent {
            version: "1".to_owned(),
            ..NeuroEvent::default()
        };
        "trigger".clone_into(&mut message.header.frame_id);
        EventStream {
            message,
            ledger: Ledger::default(),
            unknown: 0,
            reported: 0,
        }
    }

    /// Accepts any number for the next event. While no stream is active, the device numbers events
    /// but does not send them.
    pub(crate) fn restart(&mut self) {
        self.ledger.expect_any();
    }

    pub(crate) fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Returns the number of events lost since the last call.
    pub(crate) fn lost_since_report(&mut self) -> u64 {
        let reported = std::mem::replace(&mut self.reported, self.ledger.lost());
        self.ledger.lost() - reported
    }

    /// Publishes an event that happened at `device_us` and returns the trigger's new level.
    ///
    /// If `device_us` is `None` because the device's time was impossible, the stamp is the time at
    /// which the event was read. Returns `None` for a replay and for an event of an unknown kind,
    /// which are not published.
    pub(crate) fn receive(
        &mut self,
        event: Event,
        device_us: Option<u64>,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) -> Option<u16> {
        let Arrival::New { lost } = self.ledger.record(event.number) else {
            return None;
        };
        if lost > 0 {
            tracing::warn!(lost, before = event.number, "events lost");
        }
        let (code, level, description) = match event.kind {
            EventKind::TriggerRise => (TRIGGER_RISE, 1, "trigger high"),
            EventKind::TriggerFall => (TRIGGER_RISE | END_OF_EVENT, 0, "trigger low"),
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
        let message = &mut self.message;
        let time = device_us.and_then(|us| reception.clock.wall_ns(i128::from(us)));
        let time = time.unwrap_or(reception.read.wall_ns);
        message.header.stamp = Stamp::from_nanoseconds(time);
        message.neuroheader.seq = message.neuroheader.seq.wrapping_add(1);
        message.header.seq = message.neuroheader.seq;
        message.event = code;
        description.clone_into(&mut message.description);
        effects.publish_event(message);
        Some(level)
    }
}
