//! The event message of ROS-Neuro.

use serde::Serialize;

use crate::header::{Header, NeuroHeader};
use crate::wire::impl_wire;

/// `rosneuro_msgs/NeuroEvent`: an event such as a trigger edge.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NeuroEvent {
    /// ROS header; its `stamp` is the start of the event.
    pub header: Header,
    /// ROS-Neuro header; its `seq` is the sequence number of the event.
    pub neuroheader: NeuroHeader,
    /// Version of the event code table, as free text.
    pub version: String,
    /// Event code as in a GDF event table. Bit 15 (0x8000) marks the end of the event.
    pub event: i32,
    /// Duration, s; 0 if unknown.
    pub duration: f32,
    /// Group of event codes that `event` belongs to.
    pub family: i32,
    /// Description of the event for display.
    pub description: String,
}

impl NeuroEvent {
    /// Code of a rising edge of the trigger input. A falling edge is its end.
    pub const TRIGGER: i32 = 0x0001;
    /// Bit of [`NeuroEvent::event`] that marks the end of an event, which ROS-Neuro calls OFF.
    pub const END: i32 = 0x8000;

    /// Returns an event of the bus without number, time and code.
    pub fn on_bus() -> NeuroEvent {
        let mut event = NeuroEvent {
            version: "1".to_owned(),
            ..NeuroEvent::default()
        };
        "trigger".clone_into(&mut event.header.frame_id);
        event
    }

    /// Returns the code and the description of an edge of the trigger input.
    pub const fn trigger_edge(is_rising: bool) -> (i32, &'static str) {
        if is_rising {
            (Self::TRIGGER, "trigger high")
        } else {
            (Self::TRIGGER | Self::END, "trigger low")
        }
    }
}

impl_wire!(NeuroEvent {
    header: Header,
    neuroheader: NeuroHeader,
    version: String,
    event: i32,
    duration: f32,
    family: i32,
    description: String,
});
