//! From edges of the trigger input to events of `/events/bus`.

use link::{Event, EventKind};
use neuro_ros::{NeuroEvent, Stamp};

use crate::effects::Effects;
use crate::streams::ledger::{Arrival, Ledger};
use crate::streams::stamps::Reception;

/// Code of a rising edge: the first of those that GDF's event table leaves to the user.
const TRIGGER_RISE: i32 = 0x0001;
/// Ends an event, in GDF's event table as on ROS-Neuro's bus (its protocols name it END_OF_EVENT, 32768).
const END_OF_EVENT: i32 = 0x8000;

/// From edges of the trigger input to events of `/events/bus`, and to the level between them.
#[derive(Debug)]
pub(crate) struct EventStream {
    message: NeuroEvent,
    ledger: Ledger,
    /// Events of a kind that this bridge does not know.
    pub(crate) unknown: u64,
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

    /// What happens while nothing streams is numbered and not sent.
    pub(crate) fn restart(&mut self) {
        self.ledger.expect_any();
    }

    pub(crate) fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Lost events since this was asked last.
    pub(crate) fn lost_since_report(&mut self) -> u64 {
        let reported = std::mem::replace(&mut self.reported, self.ledger.lost());
        self.ledger.lost() - reported
    }

    /// An event came, which happened at `device_us` unless that cannot be; returns the trigger's
    /// new level.
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
                    tracing::warn!(kind, "events that are newer than this bridge are left out");
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
