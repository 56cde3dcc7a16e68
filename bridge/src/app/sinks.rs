//! The sinks of all topics.

use link::Streams;
use neuro_ros::ros1::NodeError;
use neuro_ros::{DiagnosticArray, FrameSink, NdjsonWriter, NeuroEvent, Sink};

use crate::app::command_line::Options;
use crate::app::ros_node::RosNode;

/// Queue length per subscriber for frames of codes and of reconstructed signals: 8.5 minutes at 16
/// frames per second. After a long outage all fillers are published at once, and a recorder must
/// receive all of them. A frame takes about 3 KB, and only slow subscribers have frames waiting.
const QUEUE_FRAMES: usize = 8192;
/// Queue length per subscriber for frames of samples and of filtered steps. The queue holds the
/// longest gap that is filled: 120 s at 16 frames per second, 1,920 frames of about 9 KB each.
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
}

/// Topic names with the prefix applied; `None` for streams that are not requested.
struct Names {
    encoded: String,
    reconstructed: String,
    raw: Option<String>,
    filtered: Option<String>,
    events: Option<&'static str>,
    diagnostics: &'static str,
}

impl Names {
    fn new(options: &Options) -> Names {
        let streams = options.settings().streams;
        let requested = |stream, name| streams.contains(stream).then(|| options.topic(name));
        Names {
            encoded: options.topic("encoded"),
            reconstructed: options.topic("neurodata_reconstructed"),
            raw: requested(Streams::RAW, "neurodata"),
            filtered: requested(Streams::FILTERED, "neurodata_corticode"),
            // These topics have no prefix: all of ROS-Neuro shares one event bus, and one
            // aggregator collects all diagnostics.
            events: streams.contains(Streams::EVENTS).then_some("/events/bus"),
            diagnostics: "/diagnostics",
        }
    }
}

impl Sinks {
    /// Advertises the topics at a ROS node.
    pub(crate) async fn ros(ros: &RosNode, options: &Options) -> Result<Sinks, NodeError> {
        let names = Names::new(options);
        let mut sinks = Sinks {
            encoded: Box::new(ros.sink(&names.encoded, QUEUE_FRAMES).await?),
            reconstructed: Box::new(ros.sink(&names.reconstructed, QUEUE_FRAMES).await?),
            raw: None,
            filtered: None,
            events: None,
            diagnostics: Box::new(ros.sink(names.diagnostics, QUEUE_EVENTS).await?),
        };
        if let Some(raw) = &names.raw {
            sinks.raw = Some(Box::new(ros.sink(raw, QUEUE_SAMPLES).await?));
        }
        if let Some(filtered) = &names.filtered {
            sinks.filtered = Some(Box::new(ros.sink(filtered, QUEUE_SAMPLES).await?));
        }
        if let Some(events) = names.events {
            sinks.events = Some(Box::new(ros.sink(events, QUEUE_EVENTS).await?));
        }
        Ok(sinks)
    }

    /// Creates sinks that write lines of JSON.
    pub(crate) fn ndjson(lines: &NdjsonWriter, options: &Options) -> Sinks {
        let names = Names::new(options);
        let frames = |name: String| Box::new(lines.sink(&name)) as Box<dyn FrameSink>;
        Sinks {
            encoded: frames(names.encoded),
            reconstructed: frames(names.reconstructed),
            raw: names.raw.map(frames),
            filtered: names.filtered.map(frames),
            events: names
                .events
                .map(|name| Box::new(lines.sink(name)) as Box<dyn Sink<NeuroEvent>>),
            diagnostics: Box::new(lines.sink(names.diagnostics)),
        }
    }
}
