//! Where every topic goes.

use link::Streams;
use neuro_ros::ros1::NodeError;
use neuro_ros::{DiagnosticArray, FrameSink, NdjsonWriter, NeuroEvent, Sink};

use crate::app::command_line::Options;
use crate::app::ros_node::RosNode;

/// Frames of codes, and of what is decoded of them, that may wait for each subscriber: 8 min at 16
/// Hz, so that even the fillers of a long outage, which come at once, reach a recorder. About 3 KB
/// each, and only if it is slow.
const QUEUE_FRAMES: usize = 8192;
/// Frames of samples: as many as fill the longest gap that is filled (120 s at 16 Hz), about 9 KB
/// each.
const QUEUE_SAMPLES: usize = 2048;
/// Events: more than a recorder takes in at once.
const QUEUE_EVENTS: usize = 1024;

/// Where every topic goes. Each has a queue of its own: a slow reader of samples loses samples, and
/// nobody a code. Streams that are not asked for are not offered either.
pub(crate) struct Sinks {
    pub(crate) encoded: Box<dyn FrameSink>,
    pub(crate) reconstructed: Box<dyn FrameSink>,
    pub(crate) raw: Option<Box<dyn FrameSink>>,
    pub(crate) filtered: Option<Box<dyn FrameSink>>,
    pub(crate) events: Option<Box<dyn Sink<NeuroEvent>>>,
    pub(crate) diagnostics: Box<dyn Sink<DiagnosticArray>>,
}

/// Full names of the topics.
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
        let asked = |stream, name| streams.contains(stream).then(|| options.topic(name));
        Names {
            encoded: options.topic("encoded"),
            reconstructed: options.topic("neurodata_reconstructed"),
            raw: asked(Streams::RAW, "neurodata"),
            filtered: asked(Streams::FILTERED, "neurodata_filtered"),
            // One bus for all of ROS-Neuro, and one place where diagnostics are aggregated: both
            // keep their names.
            events: streams.contains(Streams::EVENTS).then_some("/events/bus"),
            diagnostics: "/diagnostics",
        }
    }
}

impl Sinks {
    /// Topics of a ROS node.
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

    /// Lines of JSON.
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
