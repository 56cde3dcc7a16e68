//! Outputs of the bridge: the sinks of frames, the decoder's thread, and the bytes for the device.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use bridge_core::{
    Announcement, AuditedWindow, BackPressure, DecoderCounts, Effects, EventPlace, HostTime, Model,
    PackedReconstruction, Reconstruction, Settings, TimedCode, TimedPackedBlock, report_malformed,
};
use link::{Frame, ToHost};
use lsl::Acquisition;
use neuro_ros::{
    AcquisitionInfo, DiagnosticArray, DiagnosticLevel, DiagnosticStatus, KeyValue, NeuroEvent,
    NeuroFrame, NeuroOutput, Sink, SinkError, TriWords,
};
use tokio::sync::watch::Sender;

use crate::app::driver::PortEffects;
use crate::app::live_recording::LiveRecording;
use crate::app::outlet::{OutletCount, Tee};
use crate::app::sinks::{Events, MAX_FILLERS, Sinks, outlet_counts};
use crate::wire::connection::Event;

/// Time limit for the decoder when the bridge exits. A service manager kills a program that does
/// not exit in time: systemd after 90 s.
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
    /// Newest value sent to `announcements`. The same value is not sent again.
    announced: Option<AcquisitionInfo>,
    /// Number of dropped messages and undecoded windows in the previous report to `/diagnostics`.
    reported: u64,
    /// Number of malformed packed blocks in the previous report to `/diagnostics`.
    reported_malformed: u64,
    /// Recording of the port's bytes that the user starts and ends on the live page.
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
            // Yield to the tasks that write the sockets in this thread.
            tokio::task::yield_now().await;
            self.sinks.decoder.start_work();
        }
    }

    /// Returns whether to stop reading the port for now: many windows wait for the decoder, and the
    /// device runs ahead of real time, so it is a source (such as a fast replay) that can wait.
    pub(crate) fn must_pause(&self) -> bool {
        let decoder = &self.sinks.decoder;
        !decoder.has_ended() && self.back_pressure.must_pause(decoder.counts().waiting)
    }

    /// Waits until queued codes are decoded, for at most [`DECODER_TIMEOUT`], and until a recording
    /// is on the disk. Returns the counts of decoder and outlets. Logs how many codes were not
    /// decoded, and how many frames on `/encoded` were dropped for slow subscribers.
    pub(crate) fn finish(self) -> (DecoderCounts, Vec<OutletCount>) {
        let dropped = self.sinks.encoded.dropped();
        let not_decoded = self.sinks.decoder.counts().not_decoded;
        let Sinks { decoder, outlets, view, lsl, ros2, .. } = self.sinks;
        let counts = decoder.finish(DECODER_TIMEOUT);
        self.recording.finish(HostTime::now());
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
        let unsent = ros2.map_or(0, |ros2| ros2.waiting());
        (counts, outlet_counts(&outlets, view.as_deref(), unsent))
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
        let audits = self.sinks.decoder.audit_status();
        report.status.extend(audits);
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
        let outlets = outlet_counts(&sinks.outlets, sinks.view.as_deref(), 0);
        let decoder = sinks.decoder.counts();
        let figures = [
            ("encoded frames dropped", Some(sinks.encoded.dropped())),
            ("reconstructed frames dropped", Some(sinks.decoder.dropped())),
            ("windows not decoded", Some(decoder.not_decoded)),
            ("raw frames dropped", dropped(&sinks.raw)),
            ("filtered frames dropped", dropped(&sinks.filtered)),
            ("predictions dropped", sinks.predictions.as_ref().map(Sink::dropped)),
            ("events dropped", sinks.events.as_ref().map(Events::dropped)),
        ];
        // Sum the drops of the outlets alone: the drops of the sinks, listed above, are the same
        // messages.
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
            KeyValue::new("windows' longest wait ms", &decoder.longest_wait.as_millis()),
            KeyValue::new("windows not needed", &decoder.not_needed),
        ];
        let view = sinks.view.iter();
        let viewers = view.map(|view| KeyValue::new("viewers", &view.viewers()));
        let lsl = sinks.lsl.iter();
        let received = lsl.map(|lsl| KeyValue::new("lsl streams received", &lsl.received()));
        let receivers = viewers.chain(received);
        let outlets = outlets.iter().map(OutletCount::value).chain(receivers);
        let topics = sinks.topics.iter().flat_map(|topics| topics.values());
        let topic = sinks.events.as_ref().and_then(|events| events.topic.as_ref());
        let recorders = topic.and_then(|(topic, _)| topic.recorders());
        DiagnosticStatus::new(
            "outlets",
            (level, message),
            values.chain(work).chain(outlets).chain(topics).chain(recorders).collect(),
        )
    }

    /// Notes the device time of a received code or packed block, from which [`Outlets::must_pause`]
    /// finds out whether the device runs ahead of real time.
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
