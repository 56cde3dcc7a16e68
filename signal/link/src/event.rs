//! Edges at the device's inputs.

use serde::{Deserialize, Serialize};

/// An edge at one of the device's inputs; sent if requested.
///
/// The header's time is that of the edge itself, at the resolution of the device's clock, so that
/// an experiment's trigger can be placed between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// Input and direction of the edge.
    pub kind: EventKind,
    /// Number of the event, counted since boot over all kinds; wraps. A gap means that events were
    /// lost.
    pub number: u32,
    /// Index since `Start` of the first ADC sample whose DRDY edge was at or after the event.
    pub sample: u64,
}

/// Input and direction of an edge; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum EventKind {
    /// 0: the trigger input went high.
    TriggerRise,
    /// 1: the trigger input went low.
    TriggerFall,
    /// Any other: a kind newer than this host.
    Newer(u8),
}

impl From<u8> for EventKind {
    fn from(byte: u8) -> EventKind {
        match byte {
            0 => EventKind::TriggerRise,
            1 => EventKind::TriggerFall,
            newer => EventKind::Newer(newer),
        }
    }
}

impl From<EventKind> for u8 {
    fn from(kind: EventKind) -> u8 {
        match kind {
            EventKind::TriggerRise => 0,
            EventKind::TriggerFall => 1,
            EventKind::Newer(newer) => newer,
        }
    }
}
