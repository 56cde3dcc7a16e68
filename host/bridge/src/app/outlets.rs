//! Outputs of the bridge: the sinks of frames, the decoder's thread, and the bytes for the device.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use bridge_core::{
    AnnouncedStream, Announcement, AuditedWindow, BackPressure, DecoderCounts, DecoderThread,
    Effects, EventPlace, HostTime, Model, PackedReconstruction, RawForm, Reconstruction, Settings,
    TimedCode, TimedPackedBlock, report_malformed,
};
use link::{Frame, Streams, ToHost};
use lsl::{Acquisition, Lsl, StampScale, StreamKind};
use neuro_ros::{
    AcquisitionInfo, DiagnosticArray, DiagnosticLevel, DiagnosticStatus, KeyValue, NdjsonWriter,
    NeuroEvent, NeuroFrame, NeuroOutput, Sink, SinkError, TriWords, Wire,
};
use ros2::Ros2Message;
use serde::Serialize;
use tokio::sync::watch::Sender;
use view::{View, ViewSink, ViewTopic};

use crate::app::command_line::SinkKind;
use crate::app::driver::PortEffects;
use crate::app::event_times::EventTimes;
use crate::app::live_recording::LiveRecording;
use crate::app::outlet::{DropCount, Outlet, OutletCount, Tee};
use crate::app::recorders::{EventTopic, Recorders};
use crate::app::ros_node::{Namespace, RosNode};
use crate::app::ros_status::RosStatus;
use crate::app::ros_topics::RosTopics;
use crate::app::ros2_outlet::Ros2Outlet;
use crate::app::step_times::StepTimes;
use crate::error::BridgeError;
use crate::wire::connection::Event;

/// Longest time to wait for the decoder when the bridge ends. A service manager kills a program
/// that does not end in time: systemd after 90 s.
const DECODER_TIMEOUT: Duration = Duration::from_secs(5);

/// Executes the effects that the state machine [`Core`](bridge_core::Core) asks for: publishes
/// frames, queues codes for the decoder's thread and collects bytes for the device. No effect waits
/// for the network or the device.
pub(crate) struct Outlets {
    settings: Settings,
    model: Arc<Model>,
    sinks: Sinks,
    back_pressure: BackPressure,
    /// Channel to the task that serves `get_info`; `None` if frames go to stdout.
    announcements: Option<Sender<Option<AcquisitionInfo>>>,
    /// Answer that `get_info` was last told to give; the task is not told the same answer again.
    announced: Option<AcquisitionInfo>,
    /// Sum of all dropped and undecoded frames in the previous report to `/diagnostics`.
    reported: u64,
    /// Number of malformed packed blocks in the previous report to `/diagnostics`.
    reported_malformed: u64,
    /// What the user records while the bridge runs.
    pub(crate) recording: LiveRecording,
    /// Bytes for the device that have not been written to the port yet.
    outgoing: Vec<u8>,
    /// Error of the sink that failed most recently. The main loop takes it and shuts down.
    pub(crate) sink_error: Option<SinkError>,
}

impl Outlets {
    pub(crate) fn new(
        sinks: Sinks,
        settings: Settings,
        model: Arc<Model>,
        announcements: Option<Sender<Option<AcquisitionInfo>>>,
        recording: LiveRecording,
    ) -> Outlets {
        Outlets {
            settings,
            model,
            sinks,
            back_pressure: BackPressure::default(),
            announcements,
            announced: None,
            reported: 0,
            reported_malformed: 0,
            recording,
            outgoing: Vec::new(),
            sink_error: None,
        }
    }

    /// Passes queued codes and audits (codes with their input) to the decoder, but first lets
    /// everything that was published reach the sockets, so that decoding does not delay a code.
    pub(crate) async fn start_decoding(&mut self) {
        if self.sinks.decoder.has_prepared_work() {
            // Yields to the tasks that write the sockets, which run in this thread.
            tokio::task::yield_now().await;
            self.sinks.decoder.start_work();
        }
    }

    /// Returns whether the port must not be read for now: many windows wait for the decoder, and
    /// the device runs ahead of real time (as a fast replay does), so it can wait.
    pub(crate) fn must_pause(&self) -> bool {
        let decoder = &self.sinks.decoder;
        !decoder.has_ended() && self.back_pressure.must_pause(decoder.counts().waiting)
    }

    /// Waits until queued codes are decoded, at most for [`DECODER_TIMEOUT`], and returns the
    /// counts of decoder and outlets. Logs how many codes were not decoded, and how many frames on
    /// `/encoded` were dropped for slow subscribers.
    pub(crate) fn finish(mut self) -> (DecoderCounts, Vec<OutletCount>) {
        if let Ok(ended) = self.recording.stop(HostTime::now())
            && let Err(why) = ended.finish()
        {
            tracing::error!("the recording is not complete: {why}");
        }
        let dropped = self.sinks.encoded.dropped();
        let not_decoded = self.sinks.decoder.counts().not_decoded;
        let Sinks {
            decoder,
            outlets,
            view,
            lsl,
            ..
        } = self.sinks;
        let counts = decoder.finish(DECODER_TIMEOUT);
        if let Some(lsl) = lsl {
            lsl.finish();
        }
        if not_decoded > 0 {
            tracing::warn!(
                not_decoded,
                "codes or packed blocks replaced by fillers because the decoder was too slow"
            );
        }
        if counts.not_decoded > not_decoded {
            tracing::warn!(
                windows = counts.not_decoded - not_decoded,
                "windows that still waited for the decoder at the end are not decoded"
            );
        }
        if dropped > 0 {
            tracing::warn!(dropped, "frames of /encoded dropped for slow subscribers");
        }
        (counts, outlet_counts(&outlets, view.as_deref()))
    }

    /// Publishes the core's report on `/diagnostics`, after adding the status of sinks, decoder and
    /// ROS, the result of audits (codes compared with the model), and the malformed packed blocks.
    pub(crate) fn publish_diagnostics(&mut self, mut report: DiagnosticArray) {
        let malformed = self.sinks.decoder.counts().malformed;
        let before = std::mem::replace(&mut self.reported_malformed, malformed);
        report_malformed(&mut report, malformed, malformed - before);
        report.status.push(self.status());
        if self.sinks.view.is_some() {
            report.status.push(self.recording.status());
        }
        let ros = self.sinks.ros.iter();
        report.status.extend(ros.map(|status| status.status()));
        let ros2 = self.sinks.ros2.iter();
        report.status.extend(ros2.map(|outlet| outlet.status()));
        if let Some(mut audits) = self.sinks.decoder.audit_status() {
            audits.name.insert_str(0, "corticode: ");
            report.status.push(audits);
        }
        for status in &mut report.status {
            status.name = self.sinks.namespace.status_name(&status.name);
        }
        let published = self.sinks.diagnostics.publish(&report);
        self.record_error(published);
    }

    /// Returns the status of sinks and decoder, with the numbers of dropped and undecoded frames.
    fn status(&mut self) -> DiagnosticStatus {
        let sinks = &self.sinks;
        let dropped = |sink: &Option<Tee<NeuroFrame>>| sink.as_ref().map(Sink::dropped);
        let outlets = outlet_counts(&sinks.outlets, sinks.view.as_deref());
        let decoder = sinks.decoder.counts();
        let figures = [
            ("encoded frames dropped", Some(sinks.encoded.dropped())),
            (
                "reconstructed frames dropped",
                Some(sinks.decoder.dropped()),
            ),
            ("windows not decoded", Some(decoder.not_decoded)),
            ("raw frames dropped", dropped(&sinks.raw)),
            ("filtered frames dropped", dropped(&sinks.filtered)),
            (
                "predictions dropped",
                sinks.predictions.as_ref().map(Sink::dropped),
            ),
            ("events dropped", sinks.events.as_ref().map(Events::dropped)),
        ];
        // A sink counts its drops as dropped frames, and its outlet counts them again.
        let of_outlets: u64 = outlets.iter().map(|outlet| outlet.dropped).sum();
        let now = decoder.not_decoded + of_outlets;
        let lost = now > std::mem::replace(&mut self.reported, now);
        let objection = sinks.topics.as_ref().and_then(|topics| topics.objection());
        let (level, message) = if sinks.decoder.has_ended() {
            let message = "the decoder has ended; restart this program for reconstructed frames";
            (DiagnosticLevel::Error, message.to_owned())
        } else if let Some(objection) = objection {
            objection
        } else if lost {
            let message = "frames dropped since the last report: a subscriber or the host is slow";
            (DiagnosticLevel::Warn, message.to_owned())
        } else if let Some(closed) = outlets.iter().find(|outlet| outlet.closed) {
            let message = format!("{} receives nothing any more", closed.name());
            (DiagnosticLevel::Warn, message)
        } else {
            (DiagnosticLevel::Ok, "nothing dropped".to_owned())
        };
        let figures = figures.into_iter();
        let values = figures.filter_map(|(name, figure)| Some(KeyValue::new(name, &figure?)));
        let work = [
            KeyValue::new("windows decoded", &decoder.decoded),
            KeyValue::new("windows waiting", &decoder.waiting),
            KeyValue::new(
                "windows' longest wait ms",
                &decoder.longest_wait.as_millis(),
            ),
            KeyValue::new("windows not needed", &decoder.not_needed),
        ];
        let view = sinks.view.iter();
        let viewers = view.map(|view| KeyValue::new("viewers", &view.viewers()));
        let lsl = sinks.lsl.iter();
        let received = lsl.map(|lsl| KeyValue::new("lsl streams received", &lsl.received()));
        let receivers = viewers.chain(received);
        let outlets = outlets.iter().map(OutletCount::value).chain(receivers);
        let topics = sinks.topics.iter().flat_map(|topics| topics.values());
        let topic = sinks
            .events
            .as_ref()
            .and_then(|events| events.topic.as_ref());
        let recorders = topic.and_then(|(topic, _)| topic.recorders());
        DiagnosticStatus {
            level,
            name: "corticode: outlets".to_owned(),
            message,
            hardware_id: String::new(),
            values: values
                .chain(work)
                .chain(outlets)
                .chain(topics)
                .chain(recorders)
                .collect(),
        }
    }

    /// Notes the device time of a received code or packed block, from which
    /// [`Outlets::must_pause`] tells whether the device runs ahead of real time.
    fn record_device_time(&mut self, device_us: u64) {
        let read_us = HostTime::now().monotonic_us;
        self.back_pressure.record(device_us, read_us);
    }

    fn record_error(&mut self, published: Result<(), SinkError>) {
        if let Err(error) = published {
            self.sink_error = Some(error);
        }
    }
}

impl PortEffects for Outlets {
    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }

    fn note(&mut self, event: Event, bytes: &[u8], at: HostTime) {
        if self.sinks.view.is_some() {
            self.recording.note(event, bytes, at);
        }
    }
}

impl Effects for Outlets {
    fn send(&mut self, frame: &[u8]) {
        if self.sinks.view.is_some() {
            self.recording.sent(frame);
        }
        self.outgoing.extend_from_slice(frame);
    }

    fn note_stamps(&mut self, offset_ns: i64, event_shift_us: i64) {
        if let Some(scale) = &self.sinks.scale {
            scale.set(offset_ns, event_shift_us);
        }
    }

    fn received(&mut self, frame: &Frame<ToHost>) {
        if self.sinks.view.is_some() {
            self.recording.received(frame);
        }
    }

    fn announce(&mut self, announcement: &Announcement) {
        if let Some(lsl) = &self.sinks.lsl {
            lsl.set_device(Acquisition::new(&announcement.device));
        }
        if announcement.decodable {
            let (device, model) = (&announcement.device, &self.model);
            let packed = PackedReconstruction::new(device, model, self.settings);
            let codes = Reconstruction::new(device, Arc::clone(model), self.settings);
            let lookback = Reconstruction::lookback_steps(device, self.settings.low_latency);
            self.sinks.lookback.store(lookback, Ordering::Relaxed);
            self.sinks.decoder.start_device(codes, packed);
        }
        let Some(announcements) = &self.announcements else {
            return;
        };
        let Some(info) = &announcement.info else {
            tracing::error!(
                "get_info has no answer, because what --announce names is not published: the device refuses it, or \
                 this program's model cannot decode it; name a stream that is published"
            );
            self.announced = None;
            announcements.send_replace(None);
            return;
        };
        if self.announced.as_ref() != Some(info) {
            self.announced = Some(info.clone());
            announcements.send_replace(Some(info.clone()));
        }
    }

    fn publish_encoded(&mut self, frame: &NeuroFrame) {
        let published = self.sinks.encoded.publish(frame);
        self.record_error(published);
    }

    fn max_fillers(&self) -> u64 {
        MAX_FILLERS
    }

    fn decode(&mut self, window: TimedCode) {
        if window.z.is_some() {
            self.record_device_time(window.words.device_time_us);
        }
        self.sinks.decoder.decode(window);
    }

    fn decode_block(&mut self, block: TimedPackedBlock) {
        if block.block.is_some() {
            self.record_device_time(block.words.device_time_us);
        }
        self.sinks.decoder.decode_block(block);
    }

    fn finish_blocks(&mut self) {
        self.sinks.decoder.finish_blocks();
    }

    fn publish_raw(&mut self, frame: &NeuroFrame) {
        let published = self.sinks.raw.as_mut().map(|sink| sink.publish(frame));
        self.record_error(published.unwrap_or(Ok(())));
    }

    fn publish_filtered(&mut self, frame: &NeuroFrame) {
        let published = self.sinks.filtered.as_mut().map(|sink| sink.publish(frame));
        self.record_error(published.unwrap_or(Ok(())));
    }

    fn publish_prediction(&mut self, prediction: &NeuroOutput, _: TriWords) {
        let sink = self.sinks.predictions.as_mut();
        let published = sink.map(|sink| sink.publish(prediction));
        self.record_error(published.unwrap_or(Ok(())));
    }

    fn publish_event(&mut self, event: &NeuroEvent, place: EventPlace) {
        let events = self.sinks.events.as_mut();
        let published = events.map(|events| events.publish(event, place));
        self.record_error(published.unwrap_or(Ok(())));
    }

    fn audit(&mut self, window: AuditedWindow) {
        let model = Arc::clone(&self.model);
        self.sinks.decoder.audit(window, model);
    }
}

/// Number of frames with codes or reconstructed signals that can wait for each subscriber: 8.5
/// minutes at 16 frames per second. A frame takes about 3 KB, and frames wait only for slow
/// subscribers.
const QUEUE_FRAMES: usize = 8192;
/// Largest number of fillers for lost codes that are published at once: 4.3 minutes. They take half
/// of a subscriber's queue; the codes that follow take the other half and push no filler out.
const MAX_FILLERS: u64 = QUEUE_FRAMES as u64 / 2;
/// Number of frames with samples or filtered steps that can wait for each subscriber: more than the
/// 1,920 fillers (120 s at 16 per second, about 9 KB each) of the longest outage that is filled.
const QUEUE_SAMPLES: usize = 2048;
/// Number of messages with events or diagnostics that can wait for each subscriber. Few arrive per
/// second, so the queue outlasts the pauses in which a recorder writes to disk.
const QUEUE_EVENTS: usize = 1024;

/// One fan-out per topic, with a sink for each outlet; that of `/neurodata_reconstructed` belongs
/// to the decoder's thread. Each sink has a queue of its own, so a slow reader of samples loses
/// samples but no codes, and a slow outlet delays no other. Streams that are not requested have no
/// topic.
pub(crate) struct Sinks {
    encoded: Tee<NeuroFrame>,
    decoder: DecoderThread,
    raw: Option<Tee<NeuroFrame>>,
    filtered: Option<Tee<NeuroFrame>>,
    predictions: Option<Tee<NeuroOutput>>,
    events: Option<Events>,
    diagnostics: Tee<DiagnosticArray>,
    outlets: Vec<Arc<Outlet>>,
    /// The ROS topics on which the sinks publish; `None` without ROS.
    topics: Option<Arc<RosTopics>>,
    /// The state of the ROS node; `None` without ROS.
    ros: Option<Arc<RosStatus>>,
    /// The ROS 2 node; `None` without this outlet.
    ros2: Option<Arc<Ros2Outlet>>,
    /// The live page; `None` without this outlet.
    view: Option<Arc<View>>,
    /// The streams of the Lab Streaming Layer; `None` without this outlet.
    lsl: Option<Lsl>,
    /// What stamps mean, for these streams.
    scale: Option<Arc<StampScale>>,
    /// Number of steps from a reconstructed frame's first step to the last one of its window.
    lookback: Arc<AtomicU32>,
    namespace: Namespace,
}

/// Destinations of events. Topic and live page are separate, because they have other stamps.
struct Events {
    topic: Option<(EventTopic, DropCount)>,
    view: Option<EventTimes<ViewSink<NeuroEvent>>>,
    others: Tee<NeuroEvent>,
}

impl Events {
    /// Creates the sinks of events at all outlets; `topics` are those of ROS.
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
        Ok(Events {
            topic,
            view,
            others,
        })
    }

    fn publish(&mut self, event: &NeuroEvent, place: EventPlace) -> Result<(), SinkError> {
        if let Some((topic, drops)) = &mut self.topic {
            topic.publish(event, place.row);
            drops.update(topic.dropped());
        }
        let others = self.others.publish(event);
        // The topic goes on if all other outlets have failed.
        let published = if self.topic.is_some() { Ok(()) } else { others };
        if let Some(view) = &mut self.view {
            view.publish(event, place.device_us);
        }
        published
    }

    fn dropped(&self) -> u64 {
        let topic = self.topic.as_ref().map_or(0, |(topic, _)| topic.dropped());
        topic + self.others.dropped()
    }
}

/// Returns the counts of all outlets. The live page counts what it drops for its viewers itself.
fn outlet_counts(outlets: &[Arc<Outlet>], view: Option<&View>) -> Vec<OutletCount> {
    let dropped_later = |outlet: &Outlet| match view {
        Some(view) if outlet.kind() == SinkKind::View => view.dropped(),
        _ => 0,
    };
    let outlets = outlets.iter();
    outlets
        .map(|outlet| outlet.count(dropped_later(outlet)))
        .collect()
}

/// ROS as an outlet: the node, and the nodes that are told each frame of the announced stream;
/// `None` if events are not stamped for recorders.
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
    /// Creates a sink of the topic `name` at every outlet that takes its messages as they are. `ros`
    /// is that of ROS. `shown` is the topic's place on the live page, if it has one.
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
                    sink.transpose()?.map(boxed)
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

    /// Adds a stream of the Lab Streaming Layer to the sinks of frames, if it is an outlet.
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

/// Returns the stream of the Lab Streaming Layer with these frames.
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

/// Full names of the topics, each `None` if its stream is not requested.
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
            name.map(|name| frames(name, QUEUE_SAMPLES, stream, Some(shown)))
                .transpose()
        };
        let stream = AnnouncedStream::Reconstructed;
        let mut decoded = frames(&names.reconstructed, QUEUE_FRAMES, stream, None)?;
        let lookback = Arc::<AtomicU32>::default();
        let of_view = outlets
            .iter()
            .find(|outlet| outlet.kind() == SinkKind::View);
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
