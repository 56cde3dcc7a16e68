//! The board's behaviour between ADC and port, without time and without a port.

use link::{
    Ack, AckResult, Capabilities, Code as CodeMessage, CodeFormat, CodeValues, Counters, Decoder,
    ElectrodeQuality, Encoder, Flags, FrameError, Hello, MAX_ELECTRODES, MAX_FRAME,
    MAX_LABELS_BYTES, MAX_TEXT_BYTES, Quality as QualityMessage, ResetCause, Start, Stats, Streams,
    ToDevice, ToHost,
};
use pipeline::{Acquisition, Code, Encoder as CodeEncoder, Mains, Quality, Sample, SignalQuality};

use crate::Outbox;

const _: () = {
    assert!(model::ELECTRODES <= MAX_ELECTRODES);
    assert!(model::LABELS.len() <= MAX_LABELS_BYTES);
    assert!(model::MAINS_50.description.len() <= MAX_TEXT_BYTES);
    assert!(model::MAINS_60.description.len() <= MAX_TEXT_BYTES);
};

/// Streams that this board has.
const STREAMS: Streams = Streams::CODES;

/// Format of the codes, in the words of the link: that of the model that this program was built with.
pub const CODE_FORMAT: CodeFormat = match model::CODE_FORMAT {
    model::CodeFormat::Int8 => CodeFormat::Int8,
    model::CodeFormat::Int8Exponent => CodeFormat::Int8Exponent,
    model::CodeFormat::Int16 => CodeFormat::Int16,
};

/// Who the virtual board says it is.
#[derive(Clone, Debug)]
pub struct Identity {
    /// Differs from start to start.
    pub session_id: u32,
    /// Made-up chip id.
    pub chip_uid: [u8; 12],
}

/// Pipeline and link as on a board: samples and bytes in, frames out.
///
/// Time is an argument: the device clock in microseconds since boot.
#[derive(Debug)]
pub struct VirtualBoard {
    identity: Identity,
    mains: Mains,
    acquisition: Acquisition,
    code_encoder: CodeEncoder<'static>,
    quality: SignalQuality,
    streams: Streams,
    outbox: Outbox,
    encoder: Encoder,
    decoder: Decoder,
    stats: Stats,
    /// Values that the int8 input clipped before the last `Start`.
    clipped_before: u32,
}

impl VirtualBoard {
    /// A board that has just started: it introduces itself into the outbox.
    pub fn new(identity: Identity, mains: Mains, outbox: Outbox) -> Self {
        let mut board = Self {
            identity,
            mains,
            acquisition: Acquisition::new(mains),
            code_encoder: CodeEncoder::new(),
            quality: SignalQuality::new(mains),
            streams: Streams::empty(),
            outbox,
            encoder: Encoder::default(),
            decoder: Decoder::new(),
            stats: Stats::default(),
            clipped_before: 0,
        };
        board.introduce(0);
        board
    }

    /// Takes bytes from the host and answers the commands that they complete.
    pub fn receive(&mut self, mut bytes: &[u8], now_us: u64) {
        while let Some(outcome) = self.decoder.next::<ToDevice>(&mut bytes) {
            match outcome {
                Ok(frame) => {
                    self.stats.commands = self.stats.commands.wrapping_add(1);
                    let result = self.obey(frame.message, now_us);
                    self.send(
                        now_us,
                        &ToHost::Ack(Ack {
                            of: frame.header.seq,
                            result,
                        }),
                    );
                }
                Err(FrameError::Unknown { header, .. }) => {
                    let result = AckResult::UnknownCommand;
                    self.send(
                        now_us,
                        &ToHost::Ack(Ack {
                            of: header.seq,
                            result,
                        }),
                    );
                }
                // Counted by the decoder; there is no seq to acknowledge.
                Err(_) => {}
            }
        }
    }

    /// Takes the sample whose DRDY edge was at `now_us`. Ignored while nothing streams.
    pub fn sample(&mut self, sample: &Sample, now_us: u64) {
        if self.streams.is_empty() {
            return;
        }
        self.stats.samples += 1;
        let step = self.acquisition.push(sample);
        if let Some(code) = step.as_ref().and_then(|step| self.code_encoder.push(step)) {
            self.stats.codes_made = self.stats.codes_made.wrapping_add(1);
            self.stats.next_window = code.window.wrapping_add(1);
            self.stats.clipped_values = self
                .stats
                .clipped_values
                .wrapping_add(code.clipped_values.into());
            let last_step_us = now_us + u64::from(code.offset_us);
            self.send(last_step_us, &ToHost::Code(message(&code)));
        }
        if self
            .stats
            .samples
            .is_multiple_of(u64::from(model::ADC_RATE_HZ))
        {
            self.send_stats(now_us);
        }
        if let Some(quality) = self.quality.push(sample, step.as_ref()) {
            self.send(now_us, &ToHost::Quality(quality_message(&quality)));
        }
    }

    /// Whether a host has started the codes.
    pub fn is_streaming(&self) -> bool {
        !self.streams.is_empty()
    }

    /// What the board has counted since its start.
    pub fn stats(&self) -> Stats {
        Stats {
            streams: self.streams,
            frames_dropped: self.outbox.dropped(),
            clipped: self.clipped(),
            input_bad: input_bad(self.decoder.counters()),
            ..self.stats
        }
    }

    /// Values clipped on their way into int8 since boot, each once.
    fn clipped(&self) -> u32 {
        self.clipped_before.wrapping_add(self.acquisition.clipped())
    }

    /// Sends the counters; a board does so every second and after `Stop`.
    pub fn send_stats(&mut self, now_us: u64) {
        let stats = self.stats();
        self.send(now_us, &ToHost::Stats(stats));
    }

    fn obey(&mut self, command: ToDevice, now_us: u64) -> AckResult {
        match command {
            ToDevice::Start(start) => self.start(start, now_us),
            ToDevice::Stop => {
                self.streams = Streams::empty();
                self.send_stats(now_us);
                AckResult::Done
            }
            ToDevice::Identify => {
                self.introduce(now_us);
                AckResult::Done
            }
            ToDevice::Ping => AckResult::Done,
        }
    }

    /// Obeys a `Start`: windows and samples are counted from 0 again.
    pub fn start(&mut self, start: Start, now_us: u64) -> AckResult {
        let mains = match start.mains_hz {
            0 => Some(self.mains),
            hz => Mains::from_hz(hz),
        };
        let Some(mains) = mains else {
            return AckResult::BadArgument;
        };
        if start.streams.is_empty() || !STREAMS.contains(start.streams) {
            return AckResult::BadArgument;
        }
        if start.streams == self.streams && mains == self.mains {
            return AckResult::Done;
        }
        if mains != self.mains {
            self.mains = mains;
            self.send_capabilities(now_us);
        }
        self.clipped_before = self.clipped_before.wrapping_add(self.acquisition.clipped());
        self.acquisition = Acquisition::new(mains);
        self.code_encoder = CodeEncoder::new();
        self.quality = SignalQuality::new(mains);
        self.stats.next_window = 0;
        self.streams = start.streams;
        AckResult::Done
    }

    fn introduce(&mut self, now_us: u64) {
        let identity = self.identity.clone();
        self.send(
            now_us,
            &ToHost::Hello(Hello {
                firmware: env!("CARGO_PKG_VERSION"),
                board: "host-sim",
                chip_uid: identity.chip_uid,
                model_id: model::MODEL_ID,
                session_id: identity.session_id,
                reset_cause: ResetCause::PowerOn,
                fault: "",
            }),
        );
        self.send_capabilities(now_us);
    }

    fn send_capabilities(&mut self, now_us: u64) {
        let filter = self.mains.filter();
        self.send(
            now_us,
            &ToHost::Capabilities(Capabilities {
                adc_rate_hz: model::ADC_RATE_HZ,
                step_rate_hz: model::STEP_RATE_HZ,
                window_steps: narrow(model::STEPS),
                hop_steps: narrow(model::HOP),
                channels: narrow(model::CHANNELS),
                lsb_nv: model::LSB_NV,
                mains_hz: filter.mains_hz,
                group_delay_us: filter.group_delay_us,
                labels: model::LABELS,
                filters: filter.description,
                code_format: CODE_FORMAT,
                code_scale: model::CODE_SCALE.into(),
                code_zero_point: model::CODE_ZERO_POINT.into(),
            }),
        );
    }

    fn send(&mut self, now_us: u64, message: &ToHost<'_>) {
        let mut buffer = [0; MAX_FRAME];
        match self.encoder.encode(now_us, message, &mut buffer) {
            Ok(frame) => self.outbox.push(frame),
            // Numbered but not sendable: the host sees the gap, the count says why.
            Err(_) => self.outbox.count_dropped(),
        }
    }
}

fn message(code: &Code) -> CodeMessage {
    let mut flags = Flags::empty();
    for (set, flag) in [
        (code.saturated != 0, Flags::SATURATED),
        (code.settling, Flags::SETTLING),
        (code.clipped > 0, Flags::CLIPPED),
        (code.clipped_values > 0, Flags::CODE_CLIPPED),
    ] {
        if set {
            flags |= flag;
        }
    }
    CodeMessage {
        model_id: model::MODEL_ID,
        window: code.window,
        first_sample: code.first_sample,
        flags,
        clipped: code.clipped,
        clipped_values: code.clipped_values,
        saturated: code.saturated,
        values: values(&code.values),
    }
}

fn values(values: &pipeline::CodeValues) -> CodeValues {
    match *values {
        pipeline::CodeValues::Int8(values) => CodeValues::Int8(values),
        pipeline::CodeValues::Int8Exponent { exponent, values } => {
            CodeValues::Int8Exponent { exponent, values }
        }
        pipeline::CodeValues::Int16(values) => CodeValues::Int16(values),
    }
}

fn quality_message(quality: &Quality) -> QualityMessage {
    let electrodes = quality.electrodes.iter();
    QualityMessage {
        first_sample: quality.first_sample,
        settling: quality.settling,
        electrodes: electrodes
            .map(|electrode| ElectrodeQuality {
                rms_uv: electrode.rms_uv,
                mains_uv: electrode.mains_uv,
                mains_residual_uv: electrode.mains_residual_uv,
                samples_at_rail: electrode.samples_at_rail,
                flat: electrode.flat,
            })
            .collect(),
    }
}

/// Frames from the host that could not be used.
fn input_bad(counters: &Counters) -> u32 {
    [
        counters.crc,
        counters.cobs,
        counters.oversize,
        counters.version,
        counters.unknown,
        counters.malformed,
    ]
    .into_iter()
    .fold(0, u32::wrapping_add)
}

/// A dimension of the model as it goes over the wire.
fn narrow(dimension: usize) -> u8 {
    u8::try_from(dimension).expect("the model's dimensions are below 256")
}

#[cfg(test)]
mod tests;
