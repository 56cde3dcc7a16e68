//! The sinks of each topic at each outlet.

use std::sync::Arc;
use std::sync::atomic::AtomicU32;

use bridge_core::{AnnouncedStream, DecoderThread, EventPlace, RawForm, Settings};
use link::Streams;
use lsl::{Lsl, StampScale, StreamKind};
use neuro_ros::{
    DiagnosticArray, NdjsonWriter, NeuroEvent, NeuroFrame, NeuroOutput, Sink, SinkError, Wire,
};
use serde::Serialize;
use view::{View, ViewSink, ViewTopic};

use crate::app::command_line::SinkKind;
use crate::app::event_times::EventTimes;
use crate::app::outlet::{DropCount, Outlet, OutletCount, Tee};
use crate::app::recorders::{EventTopic, Recorders};
use crate::app::ros_node::{Namespace, RosNode};
use crate::app::ros_status::RosStatus;
use crate::app::ros_topics::RosTopics;
use crate::app::ros2_outlet::{Ros2Message, Ros2Outlet};
use crate::app::step_times::StepTimes;
use crate::error::BridgeError;

/// Number of frames with codes or reconstructed signals that can wait for each subscriber: 8.5
/// minutes at 16 frames per second. A frame takes about 3 KB, and frames wait only for slow
/// subscribers.
const QUEUE_FRAMES: usize = 8192;
/// Largest number of fillers for lost codes that are published at once: 4.3 minutes. They take half
/// of a subscriber's queue; the codes that follow take the other half and push no filler out.
pub(super) const MAX_FILLERS: u64 = QUEUE_FRAMES as u64 / 2;
/// Number of frames with samples or filtered steps that can wait for each subscriber: more than the
/// 1,920 fillers (120 s at 16 per second, about 9 KB each) of the longest outage that is filled.
const QUEUE_SAMPLES: usize = 2048;
/// Number of messages with events or diagnostics that can wait for each subscriber. Few arrive per
/// second, so the queue outlasts the pauses in which a recorder writes to disk.
const QUEUE_EVENTS: usize = 1024;

/// One fan-out per topic, with a sink for each outlet. The decoder's thread holds the fan-out of
/// `/neurodata_reconstructed`. Each sink has a queue of its own, so a slow reader of samples loses
/// samples but no codes, and a slow outlet delays no other. Streams that are not requested have no
/// topic.
pub(crate) struct Sinks {
    pub(super) encoded: Tee<NeuroFrame>,
    pub(super) decoder: DecoderThread,
    pub(super) raw: Option<Tee<NeuroFrame>>,
    pub(super) filtered: Option<Tee<NeuroFrame>>,
    pub(super) predictions: Option<Tee<NeuroOutput>>,
    pub(super) events: Option<Events>,
    pub(super) diagnostics: Tee<DiagnosticArray>,
    pub(super) outlets: Vec<Arc<Outlet>>,
    /// The ROS topics on which the sinks publish; `None` without ROS.
    pub(super) topics: Option<Arc<RosTopics>>,
    /// The state of the ROS node; `None` without ROS.
    pub(super) ros: Option<Arc<RosStatus>>,
    /// The ROS 2 node; `None` without this outlet.
    pub(super) ros2: Option<Arc<Ros2Outlet>>,
    /// The live page; `None` without this outlet.
    pub(super) view: Option<Arc<View>>,
    /// The streams of the Lab Streaming Layer; `None` without this outlet.
    pub(super) lsl: Option<Lsl>,
    /// Offsets that convert stamps to the host's monotonic time, for the Lab Streaming Layer;
    /// `None` without this outlet.
    pub(super) scale: Option<Arc<StampScale>>,
    /// Number of steps from the first step of a reconstructed frame to the last step of the window
    /// that completes the frame.
    pub(super) lookback: Arc<AtomicU32>,
    pub(super) namespace: Namespace,
}

/// Destinations of events. ROS topic and live page are separate, because their stamps differ.
pub(super) struct Events {
    pub(super) topic: Option<(EventTopic, DropCount)>,
    view: Option<EventTimes<ViewSink<NeuroEvent>>>,
    others: Tee<NeuroEvent>,
}

impl Events {
    /// Creates the sinks of events at all outlets; `topics` are the ROS topics, if any.
    async fn new(
        to: &Destinations<'_>,
        outlets: &[Arc<Outlet>],
        topics: Option<&RosTopics>,
        name: &str,
    ) -> Result<Events, BridgeError> {
        let topic = match (topics, &to.ros, outlets.first()) {
            (Some(topics), Some(ros), Some(outlet)) => {
                let sink = topics.shared(name, QUEUE_EVENTS).await?;
                let topic = EventTopic::new(sink, ros.recorders.clone());
                Some((topic, DropCount::new(Arc::clone(outlet))))
            }
            _ => None,
        };
        let mut others = to.tee(outlets, None, name, None)?;
        let of_lsl = outlets.iter().find(|outlet| outlet.kind() == SinkKind::Lsl);
        if let Some((outlet, lsl)) = of_lsl.zip(to.lsl.as_ref()) {
            others.add(outlet, boxed(lsl.events(QUEUE_EVENTS)));
        }
        let view = to.view.as_ref();
        let view = view.map(|view| EventTimes::new(view.sink(ViewTopic::Events)));
        Ok(Events { topic, view, others })
    }

    pub(super) fn publish(
        &mut self,
        event: &NeuroEvent,
        place: EventPlace,
    ) -> Result<(), SinkError> {
        if let Some((topic, drops)) = &mut self.topic {
            topic.publish(event, place.row);
            drops.update(topic.dropped());
        }
        let others = self.others.publish(event);
        // While there is a ROS topic, it is no error that all other outlets have failed.
        let published = if self.topic.is_some() { Ok(()) } else { others };
        if let Some(view) = &mut self.view {
            view.publish(event, place.device_us);
        }
        published
    }

    pub(super) fn dropped(&self) -> u64 {
        let topic = self.topic.as_ref().map_or(0, |(topic, _)| topic.dropped());
        topic + self.others.dropped()
    }
}

/// Returns the counts of all outlets. Adds the messages that the live page `view` has dropped for
/// its viewers, and the `unsent` messages that ROS 2 has accepted but will not send.
pub(super) fn outlet_counts(
    outlets: &[Arc<Outlet>],
    view: Option<&View>,
    unsent: u64,
) -> Vec<OutletCount> {
    let dropped_later = |outlet: &Outlet| match (outlet.kind(), view) {
        (SinkKind::View, Some(view)) => view.dropped(),
        (SinkKind::Ros2, _) => unsent,
        _ => 0,
    };
    let outlets = outlets.iter();
    outlets.map(|outlet| outlet.count(dropped_later(outlet))).collect()
}

/// ROS as an outlet: the node, and the recorders of the announced stream, which are `None` if
/// events are not stamped for recorders.
pub(crate) struct RosOutlet<'a> {
    pub(crate) node: &'a RosNode,
    pub(crate) recorders: Option<Arc<Recorders>>,
}

/// The outlets that the user has chosen.
pub(crate) struct Destinations<'a> {
    pub(crate) ros: Option<RosOutlet<'a>>,
    pub(crate) ros2: Option<Arc<Ros2Outlet>>,
    pub(crate) lines: Option<&'a NdjsonWriter>,
    pub(crate) view: Option<Arc<View>>,
    pub(crate) lsl: Option<Lsl>,
}

impl Destinations<'_> {
    /// Creates the fan-out of the topic `name` to every outlet that takes the messages unchanged.
    /// `ros` is the sink of the ROS topic, and `shown` the topic of the live page, if there are
    /// any.
    fn tee<M: Serialize + Wire + Ros2Message + 'static>(
        &self,
        outlets: &[Arc<Outlet>],
        ros: Option<Box<dyn Sink<M>>>,
        name: &str,
        shown: Option<ViewTopic>,
    ) -> Result<Tee<M>, BridgeError> {
        let mut ros = ros;
        let mut tee = Tee::new();
        for outlet in outlets {
            let sink = match outlet.kind() {
                SinkKind::Ros => ros.take(),
                SinkKind::Ros2 => {
                    let sink = self.ros2.as_ref().map(|ros2| ros2.sink(name));
                    sink.transpose()?
                }
                SinkKind::Ndjson => self.lines.map(|lines| boxed(lines.sink(name))),
                SinkKind::View => {
                    let view = self.view.as_ref().zip(shown);
                    view.map(|(view, shown)| boxed(view.sink(shown)))
                }
                SinkKind::Lsl => None,
            };
            if let Some(sink) = sink {
                tee.add(outlet, sink);
            }
        }
        Ok(tee)
    }

    /// Returns the chosen outlets. ROS is first, so that no other outlet is served before it.
    fn outlets(&self) -> Vec<Arc<Outlet>> {
        let ros = self.ros.as_ref().map(|_| SinkKind::Ros);
        let ros2 = self.ros2.as_ref().map(|_| SinkKind::Ros2);
        let lines = self.lines.map(|_| SinkKind::Ndjson);
        let view = self.view.as_ref().map(|_| SinkKind::View);
        let lsl = self.lsl.as_ref().map(|_| SinkKind::Lsl);
        let kinds = [ros, ros2, lines, view, lsl].into_iter().flatten();
        kinds.map(Outlet::new).collect()
    }

    /// Adds a stream of the Lab Streaming Layer to the sinks in `tee`, if this layer is an outlet.
    fn add_lsl(
        &self,
        outlets: &[Arc<Outlet>],
        tee: &mut Tee<NeuroFrame>,
        kind: StreamKind,
        queue: usize,
    ) {
        let outlet = outlets.iter().find(|outlet| outlet.kind() == SinkKind::Lsl);
        if let Some((outlet, lsl)) = outlet.zip(self.lsl.as_ref()) {
            tee.add(outlet, boxed(lsl.frames(kind, queue)));
        }
    }
}

/// Returns the kind of the Lab Streaming Layer stream that carries the frames of `stream`.
const fn lsl_kind(stream: AnnouncedStream) -> StreamKind {
    match stream {
        AnnouncedStream::Encoded => StreamKind::Codes,
        AnnouncedStream::Reconstructed => StreamKind::Reconstructed,
        AnnouncedStream::Raw => StreamKind::Raw,
        AnnouncedStream::Filtered => StreamKind::Filtered,
    }
}

fn boxed<M>(sink: impl Sink<M> + 'static) -> Box<dyn Sink<M>> {
    Box::new(sink)
}

/// Full names of the topics; an optional name is `None` if its stream is not requested.
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
            // This topic has no namespace, because one aggregator collects the diagnostics of all
            // bridges.
            diagnostics: "/diagnostics",
        }
    }
}

impl Sinks {
    /// Creates the sinks of all topics of `settings` at all outlets, and advertises the topics at
    /// the ROS node, if there is one. `predictions` is the topic of a classifier's predictions.
    pub(crate) async fn new(
        to: Destinations<'_>,
        settings: Settings,
        namespace: &Namespace,
        predictions: Option<&str>,
    ) -> Result<Sinks, BridgeError> {
        let names = Names::new(settings.streams, namespace);
        let outlets = to.outlets();
        let topics = to.ros.as_ref();
        let topics = topics.map(|ros| Arc::new(RosTopics::new(Arc::clone(&ros.node.node))));
        let recorders = to.ros.as_ref().and_then(|ros| ros.recorders.clone());
        let frames = |name: &str, queue, stream, shown| -> Result<Tee<NeuroFrame>, BridgeError> {
            let is_recorded = settings.announced == stream;
            let recorders = recorders.clone().filter(|_| is_recorded);
            let topic = topics.as_ref();
            let topic = topic.map(|topics| topics.frames(name, queue, recorders));
            let mut tee = to.tee(&outlets, topic.transpose()?.map(boxed), name, shown)?;
            to.add_lsl(&outlets, &mut tee, lsl_kind(stream), queue);
            Ok(tee)
        };
        let optional = |name: &Option<String>, stream, shown| {
            let name = name.as_ref();
            name.map(|name| frames(name, QUEUE_SAMPLES, stream, Some(shown))).transpose()
        };
        let stream = AnnouncedStream::Reconstructed;
        let mut decoded = frames(&names.reconstructed, QUEUE_FRAMES, stream, None)?;
        let lookback = Arc::<AtomicU32>::default();
        let of_view = outlets.iter().find(|outlet| outlet.kind() == SinkKind::View);
        if let (Some(outlet), Some(view)) = (of_view, &to.view) {
            let sink = view.sink(ViewTopic::Reconstructed);
            let sink = StepTimes::new(sink, Arc::clone(&lookback));
            decoded.add(outlet, Box::new(sink));
        }
        let encoded = frames(
            &names.encoded,
            QUEUE_FRAMES,
            AnnouncedStream::Encoded,
            Some(ViewTopic::Encoded),
        )?;
        let raw = optional(&names.raw, AnnouncedStream::Raw, ViewTopic::Raw)?;
        let filtered = AnnouncedStream::Filtered;
        let filtered = optional(&names.filtered, filtered, ViewTopic::Filtered)?;
        let topic = match &topics {
            Some(topics) => Some(topics.shared(names.diagnostics, QUEUE_EVENTS).await?),
            None => None,
        };
        let diagnostics = Some(ViewTopic::Diagnostics);
        let diagnostics = to.tee(&outlets, topic.map(boxed), names.diagnostics, diagnostics)?;
        let predictions = match predictions.map(|topic| namespace.resolve(topic)) {
            Some(name) => {
                let topic = match &topics {
                    Some(topics) => Some(topics.shared(&name, QUEUE_FRAMES).await?),
                    None => None,
                };
                Some(to.tee(&outlets, topic.map(boxed), &name, None)?)
            }
            None => None,
        };
        let events = match &names.events {
            Some(name) => Some(Events::new(&to, &outlets, topics.as_deref(), name).await?),
            None => None,
        };
        if let Some(topics) = &topics {
            topics.start().await?;
        }
        Ok(Sinks {
            encoded,
            decoder: DecoderThread::start(Box::new(decoded))?,
            raw,
            filtered,
            predictions,
            events,
            diagnostics,
            outlets,
            topics,
            ros: to.ros.map(|ros| Arc::clone(&ros.node.status)),
            ros2: to.ros2,
            view: to.view,
            scale: to.lsl.as_ref().map(Lsl::scale),
            lsl: to.lsl,
            lookback,
            namespace: namespace.clone(),
        })
    }
}
