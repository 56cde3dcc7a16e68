//! The sinks of all topics.

use bridge_core::RawForm;
use std::sync::Arc;

use link::Streams;
use neuro_ros::ros1::NodeError;
use neuro_ros::{DiagnosticArray, FrameSink, NdjsonWriter, NeuroEvent, Sink};

use crate::app::namespace::Namespace;
use crate::app::ros_node::RosNode;
use crate::app::ros_topics::RosTopics;

/// Queue length per subscriber for frames of codes and of reconstructed signals: 8.5 minutes at 16
/// frames per second. A frame takes about 3 KB, and only slow subscribers have frames waiting.
const QUEUE_FRAMES: usize = 8192;
/// Largest number of fillers that are published at once after an outage: 4.3 minutes of codes. A
/// recorder must receive all of them, and the codes after them, which have the other half of the
/// queue. More fillers would push codes out of it.
pub(crate) const MAX_FILLERS: u64 = QUEUE_FRAMES as u64 / 2;
/// Queue length per subscriber for frames of samples and of filtered steps. It has room for the
/// filler frames of the longest outage that is filled: 120 s at 16 frames per second, 1,920 frames
/// of about 9 KB each.
const QUEUE_SAMPLES: usize = 2048;
/// Queue length per subscriber for messages with events and diagnostics. Few of them arrive per
/// second, so the queue covers a recorder's pauses while it writes to disk.
const QUEUE_EVENTS: usize = 1024;

/// One sink per topic. Each sink has its own queue, so a slow reader of samples loses samples but
/// no codes. Streams that are not requested have no topic.
pub(crate) struct Sinks {
    pub(crate) encoded: Box<dyn FrameSink>,
    pub(crate) reconstructed: Box<dyn FrameSink>,
    pub(crate) raw: Option<Box<dyn FrameSink>>,
    pub(crate) filtered: Option<Box<dyn FrameSink>>,
    pub(crate) events: Option<Box<dyn Sink<NeuroEvent>>>,
    pub(crate) diagnostics: Box<dyn Sink<DiagnosticArray>>,
    /// The topics of the sinks; `None` if frames go to stdout.
    pub(crate) topics: Option<Arc<RosTopics>>,
    pub(crate) namespace: Namespace,
}

/// Full names of the topics; `None` for streams that are not requested.
struct Names {
    encoded: String,
    reconstructed: String,
    raw: Option<String>,
    filtered: Option<String>,
    events: Option<String>,
    diagnostics: &'static str,
}

impl Names {
    fn new(streams: Streams, namespace: &Namespace) -> Names {
        let requested = |stream, name| streams.contains(stream).then(|| namespace.resolve(name));
        let raw = RawForm::any_in(streams);
        Names {
            encoded: namespace.resolve("encoded"),
            reconstructed: namespace.resolve("neurodata_reconstructed"),
            raw: raw.then(|| namespace.resolve("neurodata")),
            filtered: requested(Streams::FILTERED, "neurodata_corticode"),
            events: requested(Streams::EVENTS, "events/bus"),
            // One aggregator collects the diagnostics of all namespaces.
            diagnostics: "/diagnostics",
        }
    }
}

impl Sinks {
    /// Advertises the topics at a ROS node.
    pub(crate) async fn ros(
        ros: &RosNode,
        streams: Streams,
        namespace: &Namespace,
    ) -> Result<Sinks, NodeError> {
        let names = Names::new(streams, namespace);
        let topics = Arc::new(RosTopics::new(Arc::clone(&ros.node)));
        let frames = |name: &str, queue| -> Result<Box<dyn FrameSink>, NodeError> {
            Ok(Box::new(topics.frames(name, queue)?))
        };
        let optional = |name: &Option<String>| {
            let name = name.as_ref();
            name.map(|name| frames(name, QUEUE_SAMPLES)).transpose()
        };
        let mut sinks = Sinks {
            encoded: frames(&names.encoded, QUEUE_FRAMES)?,
            reconstructed: frames(&names.reconstructed, QUEUE_FRAMES)?,
            raw: optional(&names.raw)?,
            filtered: optional(&names.filtered)?,
            events: None,
            diagnostics: Box::new(topics.shared(names.diagnostics, QUEUE_EVENTS).await?),
            topics: Some(Arc::clone(&topics)),
            namespace: namespace.clone(),
        };
        if let Some(events) = names.events {
            sinks.events = Some(Box::new(topics.shared(&events, QUEUE_EVENTS).await?));
        }
        topics.start().await?;
        Ok(sinks)
    }

    /// Creates sinks that write lines of JSON.
    pub(crate) fn ndjson(lines: &NdjsonWriter, streams: Streams, namespace: &Namespace) -> Sinks {
        let names = Names::new(streams, namespace);
        let frames = |name: String| Box::new(lines.sink(&name)) as Box<dyn FrameSink>;
        Sinks {
            encoded: frames(names.encoded),
            reconstructed: frames(names.reconstructed),
            raw: names.raw.map(frames),
            filtered: names.filtered.map(frames),
            events: names
                .events
                .map(|name| Box::new(lines.sink(&name)) as Box<dyn Sink<NeuroEvent>>),
            diagnostics: Box::new(lines.sink(names.diagnostics)),
            topics: None,
            namespace: namespace.clone(),
        }
    }
}
