//! The recorders of the announced stream, and the events that each of them receives.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use bridge_core::{HostTime, RecordingStart};
use neuro_ros::{KeyValue, NeuroEvent, NeuroFrame, RosSink, Sink};

use crate::lock;

/// Number of known nodes above which nodes without a subscription to events are removed.
const MAX_CALLERS: usize = 64;

/// Maps the name of each node that has called `get_info` to the start of its recording, or to
/// `None` until the next frame is published.
///
/// `rosneuro_recorder` calls `get_info` once, and takes the next frame as its first one. Viewers
/// and filters call it too; their entries have no effect, because they do not subscribe to events.
#[derive(Debug, Default)]
pub(crate) struct Recorders(Mutex<BTreeMap<String, Option<RecordingStart>>>);

impl Recorders {
    /// Notes that the node `caller` has called `get_info`: its recording starts with the next
    /// frame.
    pub(crate) fn note_call(&self, caller: &str) {
        lock(&self.0).insert(caller.to_owned(), None);
    }

    /// Starts a recording with `frame` as its first frame for each node that has called `get_info`
    /// since the previous frame.
    pub(crate) fn note_frame(&self, frame: &NeuroFrame) {
        for (caller, start) in &mut *lock(&self.0) {
            if start.is_none() {
                tracing::debug!(caller, frame = frame.neuroheader.seq, "recording starts");
                *start = Some(RecordingStart::new(frame, HostTime::now()));
            }
        }
    }
}

/// The topic of events. Each recorder receives events with stamps that place them at their rows in
/// the recorder's own file; other subscribers receive them as the core has stamped them.
pub(crate) struct EventTopic {
    sink: RosSink<NeuroEvent>,
    /// `None` if every subscriber receives events as the core has stamped them.
    recorders: Option<Arc<Recorders>>,
}

impl EventTopic {
    pub(crate) fn new(sink: RosSink<NeuroEvent>, recorders: Option<Arc<Recorders>>) -> EventTopic {
        EventTopic { sink, recorders }
    }

    /// Publishes `event`; recorders receive it with the stamp of row `row`, if the row is known.
    pub(crate) fn publish(&mut self, event: &NeuroEvent, row: Option<u64>) {
        let starts = self.recorders.as_ref().map(|recorders| lock(&recorders.0));
        self.sink.publish_each(event, |subscriber| {
            let start = starts.as_ref()?.get(subscriber)?.as_ref()?;
            let mut event = event.clone();
            event.header.stamp = start.stamp(row?);
            Some(event)
        });
    }

    /// Returns the number of events dropped because a subscriber was too slow.
    pub(crate) fn dropped(&self) -> u64 {
        self.sink.dropped()
    }

    /// Returns the names of the recorders that subscribe to events, as a value for `/diagnostics`;
    /// `None` if events are not stamped for recorders.
    pub(crate) fn recorders(&self) -> Option<KeyValue> {
        let lags = self.sink.publisher().lags();
        let subscribes = |name: &String| lags.iter().any(|lag| lag.subscriber == *name);
        let mut starts = lock(&self.recorders.as_ref()?.0);
        if starts.len() > MAX_CALLERS {
            starts.retain(|name, _| subscribes(name));
        }
        let started = starts.iter().filter(|(_, start)| start.is_some());
        let names = started.map(|(name, _)| name).filter(|name| subscribes(name));
        let names: Vec<&str> = names.map(String::as_str).collect();
        Some(KeyValue::new("events placed for", &names.join(" ")))
    }
}
