//! The stream of trigger events, published on `/events/bus`.

use link::{Event, EventKind};

use crate::effects::Effects;
use crate::streams::bus::{BusEvent, EventBus};
use crate::streams::ledger::{Arrival, Ledger};
use crate::streams::stamps::Reception;

/// Converts trigger edges to events on `/events/bus` and counts lost edges.
#[derive(Debug, Default)]
pub(crate) struct EventStream {
    ledger: Ledger,
    /// Number of events of a kind that this bridge does not know.
    pub(crate) unknown: u64,
    /// Number of lost events at the last report to `/diagnostics`.
    reported: u64,
}

impl EventStream {
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
        bus: &mut EventBus,
        effects: &mut dyn Effects,
    ) -> Option<u16> {
        let Arrival::New { lost } = self.ledger.record(event.number) else {
            return None;
        };
        let time = device_us.and_then(|us| reception.clock.wall_ns(i128::from(us)));
        let wall_ns = time.unwrap_or(reception.read.wall_ns);
        if lost > 0 {
            tracing::debug!(lost, before = event.number, "events lost");
            bus.publish(&BusEvent::EdgesLost(lost), wall_ns, effects);
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
        bus.publish(&edge, wall_ns, effects);
        Some(level)
    }
}
