//! From edges of the trigger input to events of `/events/bus`.

use link::{Event, EventKind};
use neuro_ros::{NeuroEvent, Stamp};

use crate::effects::Effects;
use crate::streams::ledger::{Arrival, Ledger};
use crate::streams::stamps::Moment;

/// Code of a rising edge: the first of those that GDF's event table leaves to the user.
const TRIGGER: i32 = 0x0001;
/// Ends an event, in GDF's event table as on ROS-Neuro's bus (its protocols name it OFF, 32768).
const OFF: i32 = 0x8000;

/// From edges of the trigger input to events of `/events/bus`, and to the level between them.
#[derive(Debug)]
pub(crate) struct EventStream {
    message: NeuroEvent,
    ledger: Ledger,
    /// Events of a kind that this bridge does not know.
    pub(crate) unknown: u64,
    told: u64,
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
            told: 0,
        }
    }

    /// What happens while nothing streams is numbered and not sent.
    pub(crate) fn begin(&mut self) {
        self.ledger.expect_any();
    }

    pub(crate) fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Lost events since this was asked last.
    pub(crate) fn lost_since_told(&mut self) -> u64 {
        let told = std::mem::replace(&mut self.told, self.ledger.lost());
        self.ledger.lost() - told
    }

    /// An event came, which happened at `device_us` unless that cannot be; returns the trigger's
    /// new level.
    pub(crate) fn event(
        &mut self,
        event: Event,
        device_us: Option<u64>,
        moment: Moment<'_>,
        effects: &mut dyn Effects,
    ) -> Option<u16> {
        let Arrival::New { lost } = self.ledger.arrived(event.number) else {
            return None;
        };
        if lost > 0 {
            tracing::warn!(lost, before = event.number, "events lost");
        }
        let (code, level, description) = match event.kind {
            EventKind::TriggerRise => (TRIGGER, 1, "trigger high"),
            EventKind::TriggerFall => (TRIGGER | OFF, 0, "trigger low"),
            EventKind::Newer(kind) => {
                if self.unknown == 0 {
                    tracing::warn!(kind, "events that are newer than this bridge are left out");
                }
                self.unknown += 1;
                return None;
            }
        };
        let message = &mut self.message;
        let time = device_us.and_then(|us| moment.clock.wall_ns(i128::from(us)));
        let time = time.unwrap_or(moment.read.wall_ns);
        message.header.stamp = Stamp::from_nanoseconds(time);
        message.neuroheader.seq = message.neuroheader.seq.wrapping_add(1);
        message.header.seq = message.neuroheader.seq;
        message.event = code;
        description.clone_into(&mut message.description);
        effects.event(message);
        Some(level)
    }
}
