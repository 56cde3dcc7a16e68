//! Handling of messages from the device and of commands to the device.

mod hops;
mod introduction;
mod reports;
pub(crate) mod state;

use link::{
    Ack, AckResult, Frame, FrameError, Header, MAX_FRAME, Stats, Streams, ToDevice, ToHost,
};

use crate::diagnostics::converters::ChainReport;
use crate::diagnostics::timing;
use crate::effects::Effects;
use crate::session::state::Session;
use crate::settings::StreamKind;
use crate::streams::ledger::Arrival;
use crate::streams::side::MessageTime;
use crate::streams::stamps::Reception;
use crate::time::host_time::HostTime;
use crate::wire::commands::AckEffect;
use crate::wire::words;

/// Number of consecutive frames with an old sequence number after which the bridge sends `Identify`
/// again. The device may have been reset and its `Hello` lost.
const OLD_FRAMES_BEFORE_IDENTIFY: u32 = 8;

impl Session {
    pub(crate) fn connected(&mut self, now: HostTime, effects: &mut dyn Effects) {
        self.introduced = false;
        self.counts.connections += 1;
        self.commands.connected(now.monotonic_us);
        self.tick(now, effects);
    }

    pub(crate) fn disconnected(&mut self) {
        self.introduced = false;
        self.commands.disconnected();
    }

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

    /// Handles the error for bytes that are not a valid frame, or for a frame of a kind that this
    /// bridge does not know.
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
            // Logged at debug level, because noise on the line would fill the log; `/diagnostics`
            // counts these frames.
            tracing::debug!(%error, "frame ignored");
        }
    }

    pub(crate) fn handle_frame(
        &mut self,
        frame: &Frame<ToHost>,
        read: HostTime,
        effects: &mut dyn Effects,
    ) {
        self.handle_message(frame, read, effects);
        self.report_missing(read, effects);
    }

    fn handle_message(&mut self, frame: &Frame<ToHost>, read: HostTime, effects: &mut dyn Effects) {
        let header = frame.header;
        self.commands.frame_received(read.monotonic_us);
        if let ToHost::Hello(hello) = &frame.message {
            self.handle_hello(hello, header);
        }
        if self.introduced && !self.record_frame(header) {
            return;
        }
        match &frame.message {
            // `Hello` was handled above, and a session never requests a self-test.
            ToHost::Hello(_) | ToHost::SelfTest(_) => {}
            ToHost::Substitutes(substitutes) => self.substitutes = *substitutes,
            ToHost::Capabilities(capabilities) => {
                self.handle_capabilities(capabilities, read, effects);
            }
            ToHost::Code(code) => self.handle_code(code, header.device_time_us, read, effects),
            ToHost::Stats(stats) => self.handle_stats(*stats, header.device_time_us, read, effects),
            ToHost::Ack(ack) => self.handle_ack(*ack, read, effects),
            ToHost::Quality(quality) => self.quality = Some(quality.clone()),
            ToHost::Timing(timing) => {
                let known = self.worst_stage.iter().chain(&timing.stages);
                self.worst_stage = timing::closest_to_deadline(known);
                self.timing = Some(timing.clone());
            }
            ToHost::Raw(_)
            | ToHost::CompressedRaw(_)
            | ToHost::Filtered(_)
            | ToHost::Audit(_)
            | ToHost::Event(_) => {
                self.handle_side(&frame.message, header.device_time_us, read, effects);
            }
            ToHost::PackedCode(code) => {
                self.handle_packed(code, header.device_time_us, read, effects);
            }
            ToHost::Converters(converters) => {
                let report = ChainReport::from_message(self.converters.as_ref(), converters);
                let before = self.converters.replace(report);
                self.report_electrodes(before.as_ref(), header.device_time_us, read, effects);
            }
            ToHost::ClockReading(reading) => self.round_trips.record(
                self.commands.clock_query_sent_us(),
                *reading,
                header.device_time_us,
                read,
                &self.clock,
            ),
        }
    }

    /// Handles a message with samples, filtered steps, an event or an audit; `made_us` is its
    /// device time.
    fn handle_side(
        &mut self,
        message: &ToHost,
        made_us: u64,
        read: HostTime,
        effects: &mut dyn Effects,
    ) {
        if !self.introduced || !self.commands.accepts_codes() {
            self.side.unused += 1;
            return;
        }
        // The clock is fitted to codes. Samples are used for the fit only until the first code
        // arrives.
        let samples = matches!(
            message,
            ToHost::Raw(_) | ToHost::CompressedRaw(_) | ToHost::Filtered(_)
        );
        let possible = if self.clock.is_known() {
            self.clock.is_possible(made_us, read)
        } else {
            !samples || self.clock.observe(made_us, read)
        };
        let times = MessageTime {
            device_us: possible.then_some(made_us),
            read,
            clock: &self.clock,
        };
        match message {
            ToHost::Raw(raw) => self.side.receive_raw(raw, times, effects),
            ToHost::CompressedRaw(raw) => self.side.receive_compressed(raw, times, effects),
            ToHost::Filtered(filtered) => self.side.receive_filtered(filtered, times, effects),
            ToHost::Event(event) => self.side.receive_event(*event, times, effects),
            ToHost::Audit(audit) => {
                let model = self.model.as_deref();
                let model = model.filter(|_| self.objection.is_none());
                self.side.receive_audit(audit, model, effects);
            }
            _ => {}
        }
    }

    /// Restarts all streams, because the device counts windows, samples and steps from 0 again.
    fn restart_streams(&mut self) {
        if let Some(codes) = &mut self.codes {
            codes.restart();
        }
        if let Some(packed) = &mut self.packed {
            packed.restart();
        }
        self.side.restart();
    }

    /// Ends the recording of all streams, because the user stopped them.
    fn end_recording(&mut self, effects: &mut dyn Effects) {
        effects.finish_blocks();
        if let Some(codes) = &mut self.codes {
            codes.end_recording();
        }
        if let Some(packed) = &mut self.packed {
            packed.end_recording();
        }
        self.side.end_recording();
    }

    /// Records the sequence number of a frame and returns false if the frame is a replay.
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

    fn handle_stats(
        &mut self,
        stats: Stats,
        device_us: u64,
        read: HostTime,
        effects: &mut dyn Effects,
    ) {
        self.stats = Some(stats);
        if !self.commands.is_possibly_streaming() {
            return;
        }
        let Some(codes) = &mut self.codes else { return };
        let codes_or_packed = Streams::CODES | Streams::PACKED;
        let streams = stats.streams != stats.streams.without(codes_or_packed);
        if streams {
            self.commands.stream_received(read.monotonic_us);
            codes.mark_running();
        }
        if !codes.is_running() {
            return;
        }
        // The clock is fitted to codes. A `Stats` message is used for the fit only until the first
        // code arrives.
        if !self.clock.admits(device_us, read) && !self.clock.observe(device_us, read) {
            return;
        }
        let reception = Reception {
            read,
            clock: &self.clock,
            trigger: &self.side.trigger,
        };
        // The window index is that of codes. A replay also states it to a host that asks for packed blocks alone.
        if self.commands.streams().contains(Streams::CODES) {
            codes.fill_before(stats.next_window, device_us, reception, effects);
        }
        if !streams && self.commands.wants_stream() {
            tracing::warn!("the device stopped streaming by itself; starting it again");
            self.commands.device_stopped();
            self.restart_streams();
        }
    }

    fn handle_ack(&mut self, ack: Ack, read: HostTime, effects: &mut dyn Effects) {
        match self
            .commands
            .handle_ack(ack.of, ack.result, read.monotonic_us)
        {
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
                    codes.mark_running();
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
            AckEffect::Refused(command, result) => {
                tracing::error!("{}", words::refusal(&command, result));
                if matches!(command, ToDevice::Start(_)) {
                    self.announce_other_streams(read, effects);
                }
            }
        }
    }

    /// Logs that the device keeps its rate of the packed code. This is no warning if the model's rate was refused,
    /// which nobody needs to have chosen.
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
}
