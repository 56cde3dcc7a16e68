//! The session with a device: handles the device's messages and sends it commands.

pub(crate) mod diagnosis;
mod introduction;
pub(crate) mod summary;

use std::sync::Arc;

use artifact::classifier::Classifier;
use link::{
    Ack, AckResult, BandPass, Code, Encoder, Exclusion, FeatureFilters, Features, Frame,
    FrameError, Header, Impedance, MAX_FRAME, PackedCode, Quality, SelfTest, StageTiming, Stats,
    Streams, Substitutes, Timing, ToDevice, ToHost,
};

use crate::core::{Effects, EventPlace};
use crate::decoder::model::Model;
use crate::device::{Device, Identity};
use crate::diagnostics::converters::ChainReport;
use crate::diagnostics::packed::PackedReport;
use crate::diagnostics::{LinkLog, closest_to_deadline};
use crate::exclusion::{self, Exclusions};
use crate::impedance::ImpedanceReport;
use crate::query::report::{DeviceSummary, SelfTestReport};
use crate::settings::{AnnouncedStream, Settings, StreamKind};
use crate::streams::code::CodeStream;
use crate::streams::event::{BusEvent, Trigger};
use crate::streams::features::FeatureStream;
use crate::streams::hop_timeline::HopTimeline;
use crate::streams::ledger::{Arrival, Ledger};
use crate::streams::packed::PackedStream;
use crate::streams::rows::NextRow;
use crate::streams::sample::SampleStream;
use crate::streams::side::SideStreams;
use crate::streams::stamps::{DecodedStream, Decoding, Reception};
use crate::time::HostTime;
use crate::time::clock::Clock;
use crate::time::round_trip::RoundTrips;
use crate::wire::commands::{AckEffect, Commands};
use crate::wire::self_test::SelfTestState;
use crate::wire::upload::Upload;
use crate::wire::words;

/// Number of consecutive frames with an old sequence number after which the bridge sends `Identify`
/// again, because the device may have restarted and its `Hello` may have been lost.
const OLD_FRAMES_BEFORE_IDENTIFY: u32 = 8;

/// State that the bridge keeps about the device, even while the port is closed.
#[derive(Debug)]
pub(crate) struct Session {
    settings: Settings,
    model: Option<Arc<Model>>,
    /// Rate of the packed code that the model states, 0 (finest) to 15; `None` without a packed
    /// code. The core sets the device to this rate unless the user chose another.
    model_rate: Option<u8>,
    encoder: Encoder,
    pub(crate) commands: Commands,
    identity: Option<Identity>,
    /// Whether `Hello` has arrived since the port was opened. Until then, the sequence numbers of
    /// frames are ignored.
    introduced: bool,
    codes: Option<CodeStream>,
    packed: Option<PackedStream>,
    /// The classifier of features; `None` if the user gave none.
    classifier: Option<Arc<Classifier>>,
    features: Option<FeatureStream>,
    side: SideStreams,
    trigger: Trigger,
    /// The device that was announced last. The bridge refuses every device that is not compatible
    /// with it, for as long as the bridge runs.
    announced: Option<Arc<Device>>,
    /// Stream from which `/neurodata_reconstructed` is decoded, as last announced.
    decoding: Decoding,
    /// Whether, at the newest announcement, the bridge asked the device for the stream that
    /// `/acquisition/get_info` describes, and the device did not refuse to stream.
    is_described_asked: bool,
    clock: Clock,
    round_trips: RoundTrips,
    frames: Ledger,
    old_frames_in_a_row: u32,
    counts: SessionCounts,
    /// Reason, worded for the user, why codes or decoded signals are not published.
    objection: Option<String>,
    stats: Option<Stats>,
    /// Newest signal quality of the electrodes; `None` after `/diagnostics` has published it.
    quality: Option<Quality>,
    /// Newest impedance of the electrodes; `None` after `/diagnostics` has published it.
    impedance: Option<ImpedanceReport>,
    /// Resistance in series with each electrode on the board, ohms, as the user states it.
    series_ohms: u32,
    /// Newest report of processing times; `None` after `/diagnostics` has published it.
    timing: Option<Timing>,
    /// Of all processing stages reported so far, the stage with the largest ratio of worst time to
    /// deadline.
    worst_stage: Option<StageTiming>,
    converters: Option<ChainReport>,
    /// Result of the self-test that the user has asked for, until it is taken.
    self_test: Option<Box<SelfTestReport>>,
    /// Electrodes without a recorded signal, according to the device's newest introduction.
    substitutes: Substitutes,
    /// The user's choice of electrodes to exclude.
    pub(crate) exclusions: Exclusions,
    /// Packed model that the user wants the device to use.
    pub(crate) upload: Option<Upload>,
    /// Electrodes that the device excludes, and whose signals it computes from the others; `None`
    /// before the first report of a session.
    exclusion: Option<Exclusion>,
    /// Bit mask of the electrodes that the newest event on the bus names as excluded.
    excluded: u64,
    logged: LoggedOnce,
    link_log: LinkLog,
}

/// Which warnings were logged already; each of these warnings is logged only once.
#[derive(Clone, Copy, Debug, Default)]
struct LoggedOnce {
    newer_messages: bool,
    wire_version: bool,
    /// Whether a refusal of streams was logged. Unlike the other flags, it is set to false when the
    /// device restarts or another one connects.
    refused_streams: bool,
}

/// Counts that concern the whole session, not one of its streams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct SessionCounts {
    /// Number of times that the port was opened.
    connections: u64,
    /// Number of detected resets of the device. A change to another device counts as a reset.
    resets: u64,
    /// Number of codes, packed blocks and features that were not used: they came before the
    /// device's introduction or from a refused device, or there is no classifier for the features.
    hops_unused: u64,
    /// Number of missing codes at the last report to `/diagnostics`.
    missing_reported: u64,
    /// Counts of the packed blocks at the last report to `/diagnostics`.
    packed_reported: PackedReport,
    /// Number of damaged frames at the last report to `/diagnostics`.
    damaged_reported: u32,
}

/// Device time at which a message was made, microseconds, and host time at which it was read.
#[derive(Clone, Copy, Debug)]
struct MessageTimes {
    device_us: u64,
    read: HostTime,
}

impl MessageTimes {
    /// Returns the times, clock and trigger with which the message is converted for publication. If
    /// `is_possible` is false, the device time is wrong and is left out.
    fn reception<'a>(
        self,
        is_possible: bool,
        clock: &'a Clock,
        trigger: &'a Trigger,
    ) -> Reception<'a> {
        Reception {
            device_us: is_possible.then_some(self.device_us),
            read: self.read,
            clock,
            trigger,
        }
    }
}

impl Session {
    pub(crate) fn new(settings: Settings, model: Option<Arc<Model>>) -> Session {
        let commands = Commands::new(settings.mains_hz, settings.streams, settings.packed_rate);
        let decoding =
            Decoding { stream: DecodedStream::of(commands.streams()), is_possible: false };
        let packed = model.as_ref().and_then(|model| model.packed());
        Session {
            settings,
            model_rate: packed.map(|packed| packed.description.rate),
            model,
            encoder: Encoder::default(),
            commands,
            identity: None,
            introduced: false,
            codes: None,
            packed: None,
            classifier: None,
            features: None,
            side: SideStreams::new(settings),
            trigger: Trigger::default(),
            announced: None,
            decoding,
            is_described_asked: false,
            clock: Clock::default(),
            round_trips: RoundTrips::default(),
            frames: Ledger::default(),
            old_frames_in_a_row: 0,
            counts: SessionCounts::default(),
            objection: None,
            stats: None,
            quality: None,
            impedance: None,
            series_ohms: 0,
            timing: None,
            worst_stage: None,
            converters: None,
            self_test: None,
            substitutes: Substitutes::NONE,
            exclusions: Exclusions::default(),
            upload: None,
            exclusion: None,
            excluded: 0,
            logged: LoggedOnce::default(),
            link_log: LinkLog::default(),
        }
    }

    /// Sets the classifier of features, and queues its filters for the device.
    pub(crate) fn set_classifier(&mut self, classifier: Classifier) {
        let [first, second] =
            classifier.band.sections.map(|[gain, a1, a2]| BandPass { gain, a1, a2 });
        self.commands.set_filters(FeatureFilters {
            id: classifier.id(),
            first,
            second,
            weights: &classifier.weight_bytes(),
        });
        self.classifier = Some(Arc::new(classifier));
    }

    /// Sets the packed code's rate to `rate`, which the device's model states.
    pub(crate) fn set_model_rate(&mut self, rate: u8) {
        self.model_rate = Some(rate);
        self.commands.set_rate(rate);
    }

    /// Returns the reason, worded for the user, why codes or decoded signals are not published.
    pub(crate) fn objection(&self) -> Option<&str> {
        self.objection.as_deref()
    }

    /// Records that the port was opened at `now`, and sends the first command.
    pub(crate) fn connected(&mut self, now: HostTime, effects: &mut dyn Effects) {
        self.introduced = false;
        self.counts.connections += 1;
        self.commands.connected(now.monotonic_us);
        self.tick(now, effects);
    }

    /// Records that the port was closed or lost; the state of the streams is kept.
    pub(crate) fn disconnected(&mut self) {
        self.introduced = false;
        self.commands.disconnected();
    }

    /// Sends the next command to the device if one is due at `now`.
    pub(crate) fn tick(&mut self, now: HostTime, effects: &mut dyn Effects) {
        let seq = self.encoder.next_seq();
        let Some(command) = self.commands.next_command(now.monotonic_us, seq) else {
            return;
        };
        tracing::debug!(?command, seq, "command");
        let mut buffer = [0; MAX_FRAME];
        match self.encoder.encode(0, &command, &mut buffer) {
            Ok(frame) => effects.send(frame),
            Err(error) => {
                let command = words::command(&command);
                tracing::error!(%error, "the command {command} cannot be sent");
            }
        }
    }

    /// Handles the error of the frame decoder for bytes that are no valid frame, or for a frame of
    /// a kind that this bridge does not know.
    pub(crate) fn handle_error(&mut self, error: FrameError, read: HostTime) {
        if let FrameError::Unknown { header, kind } = error {
            self.commands.frame_received(read.monotonic_us);
            if self.introduced {
                self.record_frame(header);
            }
            if !std::mem::replace(&mut self.logged.newer_messages, true) {
                tracing::warn!(
                    kind,
                    "the device sends messages that are newer than this bridge; they are ignored \
                     and codes are not affected; update the bridge to receive them"
                );
            }
        } else if let FrameError::Version(_) = error
            && !std::mem::replace(&mut self.logged.wire_version, true)
        {
            tracing::error!("the device's frames cannot be decoded: {error}");
        } else {
            // Use the debug level, because noise on the serial line would fill the log.
            // `/diagnostics` counts these frames.
            tracing::debug!(%error, "frame ignored");
        }
    }

    /// Handles `frame`, which the host read from the device's port at the time `read`.
    pub(crate) fn handle_frame(
        &mut self,
        frame: &Frame<ToHost>,
        read: HostTime,
        effects: &mut dyn Effects,
    ) {
        effects.note_stamps(self.clock.follow(read), self.side.bus.shift_us());
        // Get the next row before the message is handled: a gap that the message ends begins at
        // this row.
        let row = self.next_row(None).map(|next| next.index);
        self.handle_message(frame, read, effects);
        self.report_missing(row, read, effects);
    }

    fn handle_message(&mut self, frame: &Frame<ToHost>, read: HostTime, effects: &mut dyn Effects) {
        let header = frame.header;
        let at = MessageTimes { device_us: header.device_time_us, read };
        self.commands.frame_received(read.monotonic_us);
        if let ToHost::Hello(hello) = &frame.message {
            self.handle_hello(hello, header);
        }
        if self.introduced && !self.record_frame(header) {
            return;
        }
        match &frame.message {
            // `Hello` was handled above.
            ToHost::Hello(_) => {}
            ToHost::SelfTest(test) => self.handle_self_test(test),
            ToHost::Substitutes(substitutes) => self.substitutes = *substitutes,
            ToHost::Capabilities(capabilities) => {
                self.handle_capabilities(capabilities, read, effects);
            }
            ToHost::Code(code) => self.handle_code(code, at, effects),
            ToHost::Stats(stats) => self.handle_stats(*stats, at, effects),
            ToHost::Ack(ack) => self.handle_ack(*ack, read, effects),
            ToHost::Quality(quality) => self.quality = Some(quality.clone()),
            ToHost::Timing(timing) => {
                let known = self.worst_stage.iter().chain(&timing.stages);
                self.worst_stage = closest_to_deadline(known);
                self.timing = Some(timing.clone());
            }
            ToHost::Raw(_)
            | ToHost::CompressedRaw(_)
            | ToHost::Filtered(_)
            | ToHost::Audit(_)
            | ToHost::Event(_) => self.handle_side(&frame.message, at, effects),
            ToHost::PackedCode(code) => self.handle_packed(code, at, effects),
            ToHost::Features(features) => self.handle_features(features, at, effects),
            ToHost::Exclusion(exclusion) => self.handle_exclusion(*exclusion, at, effects),
            ToHost::Converters(converters) => {
                let report = ChainReport::from_message(self.converters.as_ref(), converters);
                let before = self.converters.replace(report);
                self.report_electrodes(before.as_ref(), at, effects);
            }
            ToHost::Impedance(impedance) => self.handle_impedance(impedance, effects),
            ToHost::ModelReceived(received) => self.commands.model_received(*received),
            ToHost::ClockReading(reading) => self.round_trips.record(
                self.commands.clock_query_sent_us(),
                *reading,
                header.device_time_us,
                read,
                &mut self.clock,
            ),
        }
    }

    /// Handles a message of a side stream: samples, filtered steps, an event or an audit.
    fn handle_side(&mut self, message: &ToHost, at: MessageTimes, effects: &mut dyn Effects) {
        if !self.accepts_codes() {
            self.side.unused += 1;
            return;
        }
        // The clock is fitted to codes, and to samples only until the first code arrives.
        let samples =
            matches!(message, ToHost::Raw(_) | ToHost::CompressedRaw(_) | ToHost::Filtered(_));
        let possible = if self.clock.is_known() {
            self.clock.is_possible(at.device_us, at.read)
        } else {
            !samples || self.clock.observe(at.device_us, at.read)
        };
        let row = match message {
            ToHost::Event(event) => self.row_of_event(event.sample, at, possible),
            _ => None,
        };
        let reception = at.reception(possible, &self.clock, &self.trigger);
        match message {
            ToHost::Raw(raw) => self.side.receive_raw(raw, reception, effects),
            ToHost::CompressedRaw(raw) => self.side.receive_compressed(raw, reception, effects),
            ToHost::Filtered(filtered) => self.side.receive_filtered(filtered, reception, effects),
            ToHost::Event(event) => {
                if let Some(level) = self.side.receive_event(*event, reception, row, effects) {
                    self.trigger.record_edge(event.sample, level);
                }
            }
            ToHost::Audit(audit) => {
                let model = self.model.as_deref();
                let model = model.filter(|_| self.objection.is_none());
                self.side.receive_audit(audit, model, effects);
            }
            _ => {}
        }
    }

    /// Returns the row of the announced stream whose signal was at the electrodes when an event
    /// happened. The event happened directly before ADC sample `sample`. If `is_possible` is false,
    /// the event's time is wrong, and the method returns the next row.
    fn row_of_event(&mut self, sample: u64, at: MessageTimes, is_possible: bool) -> Option<u64> {
        if !is_possible {
            return Some(self.next_row(None)?.index);
        }
        let rate_hz = self.codes.as_ref()?.device().adc_rate_hz;
        let event_us = self.clock.host_us(at.device_us.into());
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
        let [read_us, sample_us] = [at.read.monotonic_us as f64, sample as f64 * 1e6];
        let run_us = event_us.unwrap_or(read_us) - sample_us / f64::from(rate_hz);
        Some(self.next_row(Some(run_us))?.row_of(sample))
    }

    /// Returns the next row of the announced stream's topic; `None` before a device has introduced
    /// itself. `run_us` is the host time of the present run's ADC sample 0, microseconds, if it is
    /// known from an event of this run.
    fn next_row(&mut self, run_us: Option<f64>) -> Option<NextRow> {
        let (codes, packed) = (self.codes.as_mut()?, self.packed.as_mut()?);
        let rate_hz = codes.device().adc_rate_hz;
        let samples = match self.settings.announced {
            AnnouncedStream::Encoded => return Some(codes.next_row(run_us)),
            AnnouncedStream::Reconstructed => {
                let decoded = codes.passed + packed.passed;
                return Some(match self.decoding.stream {
                    DecodedStream::Codes => codes.next_decoded_row(decoded, run_us),
                    DecodedStream::Packed => packed.next_row(decoded, run_us),
                });
            }
            AnnouncedStream::Raw => &mut self.side.raw,
            AnnouncedStream::Filtered => &mut self.side.filtered,
        };
        Some(samples.as_mut()?.next_row(rate_hz, run_us))
    }

    /// Restarts all streams, because the device counts windows, samples and steps from 0 again.
    fn restart_streams(&mut self) {
        if let Some(codes) = &mut self.codes {
            codes.timeline.restart();
        }
        if let Some(packed) = &mut self.packed {
            packed.timeline.restart();
        }
        if let Some(features) = &mut self.features {
            features.restart();
        }
        self.side.restart();
        self.trigger.restart();
    }

    /// Ends the recording of all streams when the user stops them. The pause is not filled.
    fn end_recording(&mut self, effects: &mut dyn Effects) {
        effects.finish_blocks();
        if let Some(codes) = &mut self.codes {
            codes.end_recording();
        }
        if let Some(packed) = &mut self.packed {
            packed.end_recording();
        }
        if let Some(features) = &mut self.features {
            features.end_recording();
        }
        self.side.end_recording();
        self.trigger.restart();
    }

    /// Records a frame's sequence number. Returns false if the number is old; the caller must then
    /// ignore the frame.
    fn record_frame(&mut self, header: Header) -> bool {
        if let Arrival::New { .. } = self.frames.record(header.seq) {
            self.old_frames_in_a_row = 0;
            return true;
        }
        self.old_frames_in_a_row += 1;
        if self.old_frames_in_a_row >= OLD_FRAMES_BEFORE_IDENTIFY {
            self.old_frames_in_a_row = 0;
            self.commands.identify_again();
        }
        false
    }

    fn handle_stats(&mut self, stats: Stats, at: MessageTimes, effects: &mut dyn Effects) {
        self.stats = Some(stats);
        if !self.commands.is_possibly_streaming() {
            return;
        }
        let Some(codes) = &mut self.codes else { return };
        let hops = Streams::CODES | Streams::PACKED | Streams::FEATURES;
        let streams = stats.streams != stats.streams.without(hops);
        // If the bridge asked for none of these streams, only for others such as events, the device
        // counts as running if it reports any stream.
        let asked = self.commands.streams();
        let runs = if asked == asked.without(hops) { !stats.streams.is_empty() } else { streams };
        if runs {
            self.commands.stream_received(at.read.monotonic_us);
        }
        if streams {
            codes.timeline.mark_running();
        }
        if !codes.timeline.is_running() {
            return;
        }
        // The clock is fitted to codes, and to `Stats` messages only until the first code arrives.
        if !self.clock.admits(at.device_us, at.read) && !self.clock.observe(at.device_us, at.read) {
            return;
        }
        // Count lost codes only if codes were asked for: a replayed recording reports
        // `next_window`, which counts codes, even to a host that did not ask for them.
        if self.commands.streams().contains(Streams::CODES) {
            let reception = at.reception(true, &self.clock, &self.trigger);
            codes.fill_before(stats.next_window, reception, effects);
        }
        if !runs && self.commands.wants_stream() {
            tracing::warn!("the device stopped streaming by itself; starting it again");
            self.commands.device_stopped();
            self.restart_streams();
        }
    }

    fn handle_ack(&mut self, ack: Ack, read: HostTime, effects: &mut dyn Effects) {
        match self.commands.handle_ack(ack.of, ack.result, read.monotonic_us) {
            AckEffect::NoChange => {}
            AckEffect::Started => {
                tracing::info!("streaming {}", StreamKind::names(self.commands.streams()));
                let refused = self.commands.refused_streams();
                if !refused.is_empty() && !std::mem::replace(&mut self.logged.refused_streams, true)
                {
                    tracing::warn!(
                        "the device does not stream {}: its image or its model has no such encoder, its port \
                         is too slow, or its firmware is older than this bridge; flash another image, or \
                         change --streams",
                        StreamKind::names(refused)
                    );
                }
                self.announce_other_streams(read, effects);
                if let Some(codes) = &mut self.codes {
                    codes.timeline.mark_running();
                }
            }
            AckEffect::Stopped { by_user } => {
                tracing::debug!("stopped");
                if by_user {
                    self.end_recording(effects);
                } else {
                    self.restart_streams();
                }
            }
            AckEffect::Refused(ToDevice::SetRate { rate }, result) => {
                self.report_refused_rate(rate, result);
            }
            AckEffect::Refused(ToDevice::SetExclusion(_), result) => {
                tracing::warn!(
                    "the device excludes no electrodes: {}; its model has no table to fill them, or its firmware \
                     is older than this bridge; `trainer substitution` adds one",
                    words::reason(result)
                );
            }
            AckEffect::Refused(ToDevice::SetFeatures(_), result) => {
                let remedy = match result {
                    AckResult::BadArgument => "train a classifier with recordings of its montage",
                    AckResult::NotSupported => "play a recording that has features",
                    _ => "flash a firmware of this release",
                };
                tracing::error!(
                    "the device makes no features for the classifier: {}; {remedy}",
                    words::reason(result)
                );
            }
            AckEffect::Refused(ToDevice::SetImpedance { .. }, result) => {
                tracing::error!("{}", words::impedance_refusal(result));
            }
            AckEffect::Refused(
                ToDevice::ModelBegin(_) | ToDevice::ModelChunk(_) | ToDevice::ModelEnd,
                result,
            ) => {
                tracing::error!("{}", words::upload_refusal(result));
            }
            AckEffect::Refused(command, result) => {
                tracing::error!("{}", words::refusal(&command, result));
                if matches!(command, ToDevice::Start(_)) {
                    self.announce_other_streams(read, effects);
                }
            }
        }
    }

    /// Logs that the device refuses to set its packed code to `rate`: as a warning if the user
    /// chose this rate, as information if the model states it.
    fn report_refused_rate(&self, rate: u8, result: AckResult) {
        let text = format!(
            "the device refuses the rate {rate} of the packed code: {}; it streams no packed blocks, or always at \
             the same rate: its image or its model has no packed code, it is a replay, or its firmware is older \
             than this bridge",
            words::reason(result)
        );
        if self.model_rate == Some(rate) {
            tracing::info!("{text}");
        } else {
            tracing::warn!("{text}; choose no rate, or flash an image whose packed code has rates");
        }
    }

    /// Handles a code. The device time `at` belongs to the last step of the code's window.
    fn handle_code(&mut self, code: &Code, at: MessageTimes, effects: &mut dyn Effects) {
        let is_usable = self.expects_hops(at.read, effects);
        let Some(codes) = self.codes.as_mut().filter(|_| is_usable) else {
            self.counts.hops_unused += 1;
            return;
        };
        self.commands.stream_received(at.read.monotonic_us);
        // Restart only events and trigger here: samples and steps detect the restart by their own
        // indices, perhaps earlier.
        if codes.timeline.is_restart(code.window) {
            self.side.events.restart();
            self.trigger.restart();
        }
        let trusted = self.clock.observe(at.device_us, at.read);
        let reception = at.reception(trusted, &self.clock, &self.trigger);
        codes.receive(code, reception, effects);
    }

    /// Handles a packed block. The device time `at` belongs to the last step of the block.
    fn handle_packed(&mut self, code: &PackedCode, at: MessageTimes, effects: &mut dyn Effects) {
        let is_usable = self.expects_hops(at.read, effects);
        let Some(packed) = self.packed.as_mut().filter(|_| is_usable) else {
            self.counts.hops_unused += 1;
            return;
        };
        self.commands.stream_received(at.read.monotonic_us);
        if packed.timeline.is_restart(code.block) {
            self.side.events.restart();
            self.trigger.restart();
        }
        // The clock is fitted to codes. It is fitted to packed blocks only if no codes stream, or
        // until the first code arrives.
        let has_codes = self.commands.streams().contains(Streams::CODES);
        let trusted = if has_codes && self.clock.is_known() {
            self.clock.is_possible(at.device_us, at.read)
        } else {
            self.clock.observe(at.device_us, at.read)
        };
        let reception = at.reception(trusted, &self.clock, &self.trigger);
        packed.receive(code, reception, effects);
    }

    /// Handles the features of a hop. The device time `at` belongs to the last step of the hop.
    fn handle_features(&mut self, message: &Features, at: MessageTimes, effects: &mut dyn Effects) {
        let is_usable = self.expects_hops(at.read, effects);
        let Some(features) = self.features.as_mut().filter(|_| is_usable) else {
            self.counts.hops_unused += 1;
            return;
        };
        self.commands.stream_received(at.read.monotonic_us);
        // The clock is fitted to features only if no other stream has the time of each hop.
        let streams = self.commands.streams();
        let has_hops = streams.contains(Streams::CODES) || streams.contains(Streams::PACKED);
        let trusted = if has_hops && self.clock.is_known() {
            self.clock.is_possible(at.device_us, at.read)
        } else {
            self.clock.observe(at.device_us, at.read)
        };
        let reception = at.reception(trusted, &self.clock, &self.trigger);
        features.receive(message, reception, effects);
    }

    /// Returns whether the device's codes and packed blocks can be published: it has introduced
    /// itself since the port was opened, and this bridge started its stream.
    fn accepts_codes(&self) -> bool {
        self.introduced && self.commands.accepts_codes()
    }

    /// Returns whether codes and packed blocks of the device can be published. If the device sends
    /// other streams than announced, because an acknowledgement was lost, announces the device
    /// again.
    fn expects_hops(&mut self, read: HostTime, effects: &mut dyn Effects) -> bool {
        let is_usable = self.accepts_codes();
        if is_usable {
            self.announce_other_streams(read, effects);
        }
        is_usable
    }

    /// Publishes an event if data is missing in the announced stream, which a recorder records. The
    /// fillers for the missing data begin at row `row`. Losses in other streams cause no event.
    fn report_missing(&mut self, row: Option<u64>, read: HostTime, effects: &mut dyn Effects) {
        let [codes, packed] = [
            self.codes.as_mut().map(|codes| &mut codes.timeline),
            self.packed.as_mut().map(|packed| &mut packed.timeline),
        ]
        .map(|timeline| timeline.and_then(HopTimeline::take_missing));
        let [raw, filtered] = [&mut self.side.raw, &mut self.side.filtered]
            .map(|stream| stream.as_mut().and_then(SampleStream::take_missing));
        let from_packed = self.commands.streams().contains(Streams::PACKED);
        let missing = match self.settings.announced {
            AnnouncedStream::Reconstructed if from_packed => packed,
            AnnouncedStream::Encoded | AnnouncedStream::Reconstructed => codes,
            AnnouncedStream::Raw => raw,
            AnnouncedStream::Filtered => filtered,
        };
        let Some(missing) = missing else { return };
        let event = if missing.restarted {
            BusEvent::DeviceRestarted(missing.seconds)
        } else {
            BusEvent::DataLost(missing.seconds)
        };
        let wall_ns = self.clock.wall_ns(missing.start_us).unwrap_or(read.wall_ns);
        // If the device restarted, the missing data can begin before device time 0.
        let place =
            EventPlace { row, device_us: Some(u64::try_from(missing.start_us).unwrap_or(0)) };
        self.side.bus.publish(&event, wall_ns, place, effects);
    }

    /// Stores the result of a self-test that the user has asked for; ignores any other result.
    fn handle_self_test(&mut self, test: &SelfTest) {
        let (Some(identity), Some(codes)) = (&self.identity, &self.codes) else {
            return;
        };
        if !self.commands.self_test.is_underway() {
            return;
        }
        let device = codes.device();
        let summary = DeviceSummary::new(&identity.as_hello());
        let channels = usize::from(device.channels);
        let report = SelfTestReport::new(summary, test, channels, &device.labels);
        self.self_test = Some(Box::new(report));
        self.commands.self_test = SelfTestState::NotWanted;
    }

    /// Asks a device that does not stream to test its converters. The error says why the device
    /// cannot be asked, and what the user can do.
    pub(crate) fn start_self_test(&mut self) -> Result<(), &'static str> {
        if !self.introduced || self.codes.is_none() {
            return Err("no device answers; connect it and try again");
        }
        if matches!(
            self.commands.self_test,
            SelfTestState::Due { .. } | SelfTestState::Running { .. }
        ) {
            return Err("a self-test is underway; wait for its result");
        }
        if !self.commands.is_stopped() {
            return Err("the device streams, and a self-test interrupts that; stop it first");
        }
        self.self_test = None;
        self.commands.self_test = SelfTestState::Due { since_us: None };
        Ok(())
    }

    /// Removes and returns the result of a self-test; `None` while it is underway.
    pub(crate) fn take_self_test(&mut self) -> Option<Result<Box<SelfTestReport>, String>> {
        if let Some(report) = self.self_test.take() {
            return Some(Ok(report));
        }
        let SelfTestState::Failed(why) = &mut self.commands.self_test else {
            return None;
        };
        let why = std::mem::take(why);
        self.commands.self_test = SelfTestState::NotWanted;
        Some(Err(why))
    }

    /// Returns the wall-clock time, nanoseconds since 1970, that a stamp of a frame has at `now`.
    /// Reports the offset of stamps from the host's monotonic time to `effects`.
    fn frame_wall_ns(&mut self, now: HostTime, effects: &mut dyn Effects) -> i64 {
        let offset_ns = self.clock.follow(now);
        effects.note_stamps(offset_ns, self.side.bus.shift_us());
        now.monotonic_us * 1000 + offset_ns
    }

    /// Publishes an event at `now` with the user's `text`. Returns whether events are published.
    pub(crate) fn mark(&mut self, text: &str, now: HostTime, effects: &mut dyn Effects) -> bool {
        let row = self.next_row(None).map(|next| next.index);
        let event = BusEvent::Marker(text.to_owned());
        let device_us = self.clock.device_us_at(now.monotonic_us);
        let device_us = device_us.and_then(|us| u64::try_from(us).ok());
        let place = EventPlace { row, device_us };
        let wall_ns = self.frame_wall_ns(now, effects);
        self.side.bus.publish(&event, wall_ns, place, effects)
    }

    /// Sets the user's choice of electrodes to exclude, and queues the command if a device has
    /// introduced itself.
    pub(crate) fn set_exclusions(&mut self, exclusions: Exclusions) {
        if let Some(codes) = &self.codes {
            let (policy, _) = exclusions.policy(&codes.device().labels);
            self.commands.set_exclusion(policy);
        }
        self.exclusions = exclusions;
    }

    /// Returns the labels of the device's electrodes; `None` before it has introduced itself.
    pub(crate) fn electrodes(&self) -> Option<&[String]> {
        Some(&self.codes.as_ref()?.device().labels)
    }

    /// Converts `now` to device time, microseconds, with the fit of the clocks, and to the
    /// wall-clock time of stamps, nanoseconds since 1970. The device time is `None` before the
    /// first frame.
    pub(crate) fn times_at(&mut self, now: HostTime) -> (Option<i64>, i64) {
        let wall_ns = now.monotonic_us * 1000 + self.clock.follow(now);
        (self.clock.device_us_at(now.monotonic_us), wall_ns)
    }

    /// Publishes impedances, but only if this bridge started the run in which they were measured.
    fn handle_impedance(&mut self, impedance: &Impedance, effects: &mut dyn Effects) {
        if !self.accepts_codes() {
            return;
        }
        let Some(codes) = &self.codes else { return };
        let labels = &codes.device().labels;
        let report = ImpedanceReport::new(impedance, labels, self.series_ohms);
        effects.publish_impedance(&report);
        self.impedance = Some(report);
    }

    /// Asks the device to measure the impedance of the electrodes while it streams.
    pub(crate) fn measure_impedance(&mut self, series_ohms: u32) {
        self.series_ohms = series_ohms;
        self.commands.measure_impedance();
    }

    /// Stores which electrodes the device excludes, and publishes an event if they have changed,
    /// but only in a run that this bridge started.
    fn handle_exclusion(&mut self, report: Exclusion, at: MessageTimes, effects: &mut dyn Effects) {
        self.commands.exclusion_reported(report.policy);
        let Some(codes) = &self.codes else { return };
        if !self.accepts_codes() {
            return;
        }
        let labels = exclusion::labels(report.excluded, &codes.device().labels);
        self.exclusion = Some(report);
        let wall_ns = self.clock.wall_ns(at.device_us.into());
        let wall_ns = wall_ns.unwrap_or(at.read.wall_ns);
        self.publish_exclusion(report.excluded, labels, wall_ns, Some(at.device_us), effects);
    }

    /// Publishes an event if the excluded electrodes have changed.
    fn publish_exclusion(
        &mut self,
        excluded: u64,
        labels: Vec<String>,
        wall_ns: i64,
        device_us: Option<u64>,
        effects: &mut dyn Effects,
    ) {
        if std::mem::replace(&mut self.excluded, excluded) == excluded {
            return;
        }
        let event = BusEvent::ElectrodesExcluded(labels);
        let row = self.next_row(None).map(|next| next.index);
        let place = EventPlace { row, device_us };
        self.side.bus.publish(&event, wall_ns, place, effects);
    }

    /// Publishes an event if an electrode has lost or regained contact since the report `before`.
    fn report_electrodes(
        &mut self,
        before: Option<&ChainReport>,
        at: MessageTimes,
        effects: &mut dyn Effects,
    ) {
        let (Some(report), Some(codes)) = (&self.converters, &self.codes) else {
            return;
        };
        let labels = &codes.device().labels;
        let was_off = before.map(|before| before.electrodes_off(labels)).unwrap_or_default();
        let off = report.electrodes_off(labels);
        let event = if off == was_off {
            return;
        } else if off.is_empty() {
            BusEvent::ElectrodesOn
        } else {
            BusEvent::ElectrodesOff(off)
        };
        let wall_ns = self.clock.wall_ns(at.device_us.into());
        let wall_ns = wall_ns.unwrap_or(at.read.wall_ns);
        let row = self.next_row(None).map(|next| next.index);
        let place = EventPlace { row, device_us: Some(at.device_us) };
        self.side.bus.publish(&event, wall_ns, place, effects);
    }
}
