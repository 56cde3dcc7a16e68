//! Events on `/events/bus`: edges of the trigger input, and what a recording must show about its data.

use neuro_ros::{NeuroEvent, Stamp};

use crate::effects::Effects;

/// Bit that marks the end of an event in GDF's event table and on ROS-Neuro's event bus, where it
/// is called OFF (32768).
const END_OF_EVENT: i32 = 0x8000;

/// What an event on the bus reports.
///
/// The codes of lost data, lost edges and refused devices are the project's own; they are outside
/// GDF's user codes (1 to 255), which belong to the experiment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum BusEvent {
    /// Rising edge of the trigger input.
    TriggerHigh,
    /// Falling edge of the trigger input.
    TriggerLow,
    /// Labels of electrodes that have lost contact.
    ElectrodesOff(Vec<String>),
    /// All electrodes have contact again.
    ElectrodesOn,
    /// Seconds of data that the device made and the bridge did not receive.
    DataLost(f32),
    /// Number of edges of the trigger input that the bridge did not receive.
    EdgesLost(u32),
    /// The device was replaced by one whose codes cannot be published, for this reason.
    DeviceRefused(String),
    /// Seconds without data because the device restarted, or was replaced for that time.
    DeviceRestarted(f32),
}

impl BusEvent {
    /// Returns the event's code.
    fn code(&self) -> i32 {
        match self {
            BusEvent::TriggerHigh => 0x0001,
            BusEvent::TriggerLow => 0x0001 | END_OF_EVENT,
            // GDF's event table: artifact, failing electrode.
            BusEvent::ElectrodesOff(_) => 0x0105,
            BusEvent::ElectrodesOn => 0x0105 | END_OF_EVENT,
            BusEvent::DataLost(_) => 0x7f01,
            BusEvent::EdgesLost(_) => 0x7f02,
            BusEvent::DeviceRefused(_) => 0x7f03,
            // GDF's event table: start of a new segment, after a break.
            BusEvent::DeviceRestarted(_) => 0x7ffe,
        }
    }

    /// Returns the duration in seconds; 0 for an instant.
    fn duration_s(&self) -> f32 {
        match self {
            BusEvent::DataLost(seconds) | BusEvent::DeviceRestarted(seconds) => *seconds,
            _ => 0.0,
        }
    }

    fn description(&self) -> String {
        match self {
            BusEvent::TriggerHigh => "trigger high".to_owned(),
            BusEvent::TriggerLow => "trigger low".to_owned(),
            BusEvent::ElectrodesOff(labels) => format!("electrodes off: {}", labels.join(" ")),
            BusEvent::ElectrodesOn => "electrodes have contact".to_owned(),
            BusEvent::DataLost(seconds) => format!("data lost: {seconds:.3} s"),
            BusEvent::EdgesLost(edges) => format!("trigger edges lost: {edges}"),
            BusEvent::DeviceRefused(why) => format!("device refused: {why}"),
            BusEvent::DeviceRestarted(seconds) => format!("device restarted: {seconds:.3} s"),
        }
    }
}

/// Numbers the events of the bus and moves their stamps to where a recorder expects them.
#[derive(Debug)]
pub(crate) struct EventBus {
    message: NeuroEvent,
    /// Whether the topic exists: the user asked for events.
    enabled: bool,
    /// Time that is added to every stamp, microseconds.
    shift_us: i64,
}

impl EventBus {
    pub(crate) fn new(enabled: bool) -> EventBus {
        let mut message = NeuroEvent {
            version: "1".to_owned(),
            ..NeuroEvent::default()
        };
        "trigger".clone_into(&mut message.header.frame_id);
        EventBus {
            message,
            enabled,
            shift_us: 0,
        }
    }

    /// Sets the time that is added to every stamp, microseconds.
    pub(crate) fn set_shift(&mut self, shift_us: i64) {
        self.shift_us = shift_us;
    }

    /// Publishes an event that happened at `wall_ns` on the wall clock, nanoseconds since 1970.
    pub(crate) fn publish(&mut self, event: &BusEvent, wall_ns: i64, effects: &mut dyn Effects) {
        if !self.enabled {
            return;
        }
        let message = &mut self.message;
        let stamp_ns = wall_ns.saturating_add(self.shift_us.saturating_mul(1000));
        message.header.stamp = Stamp::from_nanoseconds(stamp_ns);
        message.neuroheader.seq = message.neuroheader.seq.wrapping_add(1);
        message.header.seq = message.neuroheader.seq;
        message.event = event.code();
        message.duration = event.duration_s();
        message.description = event.description();
        effects.publish_event(message);
    }
}
