//! A simulated board. Tests set its properties and its time.

use std::sync::{Arc, LazyLock};

use bridge_core::{HostTime, Model};
use link::{
    Ack, AckResult, Capabilities, ClockReading, Code, CodeFormat, CodeValues, Decoder, Encoder,
    Flags, Hello, MAX_FRAME, ModelBegin, ModelReceived, ResetCause, SelfTest, Stats, Streams,
    Substitutes, ToDevice, ToHost,
};

/// Wall-clock time at the start of every test, nanoseconds since 1970.
pub(crate) const WALL_START_NS: i64 = 1_700_000_000_000_000_000;

/// Returns the host time `us` microseconds after the start; its wall clock has no error.
pub(crate) fn at(us: i64) -> HostTime {
    HostTime { monotonic_us: us, wall_ns: WALL_START_NS + us * 1000 }
}

/// Checks that `text` contains each of the `parts`.
#[track_caller]
pub(crate) fn assert_has<const N: usize>(text: &str, parts: [&str; N]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in {text}");
    }
}

/// Noise from Marsaglia's xorshift (Journal of Statistical Software 8, 2003); the seed is not 0.
pub(crate) struct Noise(pub(crate) u32);

impl Noise {
    pub(crate) fn bits(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// Returns the next number, uniform in 0..1.
    pub(crate) fn number(&mut self) -> f64 {
        f64::from(self.bits() >> 8) / f64::from(1 << 24)
    }
}

/// Returns the model that is embedded in the bridge; it is read once per process.
pub(crate) fn model() -> Arc<Model> {
    static MODEL: LazyLock<Arc<Model>> = LazyLock::new(|| Arc::new(Model::embedded().unwrap()));
    Arc::clone(&MODEL)
}

/// Returns the label of a channel's electrode in the embedded model; channels count from 0.
pub(crate) fn electrode(channel: usize) -> String {
    model().electrodes()[channel].clone()
}

/// Number of values in a code of the simulated board.
pub(crate) const NUMBERS: usize = 128;

/// A board that answers commands as the firmware does. Tests set its fields.
pub(crate) struct Board {
    pub(crate) encoder: Encoder,
    pub(crate) commands: Decoder<2048>,
    pub(crate) model_id: [u8; 8],
    pub(crate) session_id: u32,
    pub(crate) labels: String,
    pub(crate) channels: u8,
    pub(crate) hop_steps: u8,
    /// Electrodes whose signal the board reports as interpolated or zero.
    pub(crate) substitutes: Substitutes,
    pub(crate) code_format: CodeFormat,
    /// Whether the board's model has a network. Without one, the board reports a code
    /// length of 0.
    pub(crate) has_network: bool,
    pub(crate) code_scale: [f32; NUMBERS],
    /// Zero points of int8 codes. With the other formats, the board reports all of them as 0.
    pub(crate) code_zero_point: [i8; NUMBERS],
    pub(crate) step_rate_hz: u16,
    pub(crate) next_window: u32,
    pub(crate) streaming: bool,
    pub(crate) chip_uid: [u8; 12],
    /// Device time of the newest code, microseconds.
    pub(crate) now_us: u64,
    /// Host time at which the board's clock was at 0, microseconds. If it is set, the board answers
    /// clock queries at once.
    pub(crate) zero_us: Option<i64>,
    /// Streams that the simulated firmware supports. The board refuses a `Start` with any other
    /// stream as `BadArgument`.
    pub(crate) supported: Streams,
    /// Result in the acknowledgements of the commands for self-test, clock query, reset,
    /// exclusion and impedance.
    pub(crate) ack_result: AckResult,
    /// Self-test result that the board sends at once after a self-test command; with `None` it
    /// sends no result.
    pub(crate) self_test: Option<SelfTest>,
    /// Whether the board restarts at once after a reset command.
    pub(crate) restarts_on_reset: bool,
    /// Rate of the packed code that the host has set, 0 (finest) to 15 (coarsest).
    pub(crate) rate: u8,
    /// Streams in the last `Start` that the board received.
    pub(crate) streams: Streams,
    /// Commands that the board received, oldest first, each with its sequence number.
    pub(crate) received: Vec<(u32, ToDevice<'static>)>,
    /// The model that is being uploaded: its announcement, and its bytes received so far; `None` if
    /// the board has no slot for a model.
    pub(crate) slot: Option<(ModelBegin, Vec<u8>)>,
}

/// Size in bytes of the largest model that a board with a slot accepts. A linear code needs more.
const LARGEST_MODEL: u32 = 10_000;

/// Id of the model with which a board with a slot was built.
pub(crate) const BUILT_IN: [u8; 8] = *b"built in";

impl Board {
    /// Creates a board with a model slot, built with another model than the host's.
    pub(crate) fn with_slot() -> Board {
        Board {
            slot: Some((ModelBegin::default(), Vec::new())),
            model_id: BUILT_IN,
            ..Board::new()
        }
    }

    pub(crate) fn new() -> Board {
        let model = model();
        Board {
            encoder: Encoder::default(),
            commands: Decoder::new(),
            model_id: model.id(),
            session_id: 1,
            labels: model.electrodes().join(" "),
            channels: 64,
            hop_steps: 8,
            substitutes: Substitutes::NONE,
            code_format: CodeFormat::Int8,
            has_network: true,
            code_scale: [0.5; NUMBERS],
            code_zero_point: [1; NUMBERS],
            step_rate_hz: 128,
            next_window: 0,
            streaming: false,
            chip_uid: [7; 12],
            now_us: 0,
            zero_us: None,
            supported: Streams::ALL,
            ack_result: AckResult::Done,
            self_test: None,
            restarts_on_reset: false,
            rate: 4,
            streams: Streams::empty(),
            received: Vec::new(),
            slot: None,
        }
    }

    /// Creates a board that refuses a `Start` with any stream outside `supported`.
    pub(crate) fn supporting(supported: Streams) -> Board {
        Board { supported, ..Board::new() }
    }

    /// Creates a board with a model that the host does not have.
    pub(crate) fn of_another_model() -> Board {
        Board { model_id: [9; 8], ..Board::new() }
    }

    /// Creates another board, whose windows overlap less than those of [`Board::new`].
    pub(crate) fn of_another_shape() -> Board {
        Board { hop_steps: 16, session_id: 77, ..Board::new() }
    }

    /// Creates a board whose acknowledgements of the commands listed at [`Self::ack_result`] have
    /// this result.
    pub(crate) fn answering(ack_result: AckResult) -> Board {
        Board { ack_result, ..Board::new() }
    }

    /// Restarts the board: it gets a new session id, and all its numbers start at 0 again.
    pub(crate) fn reboot(&mut self) {
        self.encoder = Encoder::default();
        self.session_id += 1;
        self.next_window = 0;
        self.streaming = false;
        if let Some(slot) = &mut self.slot {
            self.model_id = BUILT_IN;
            *slot = (ModelBegin::default(), Vec::new());
        }
    }

    pub(crate) fn frame(&mut self, device_us: u64, message: &ToHost) -> Vec<u8> {
        let mut buffer = [0; MAX_FRAME];
        self.encoder.encode(device_us, message, &mut buffer).unwrap().to_vec()
    }

    pub(crate) fn skip_frame(&mut self) {
        self.encoder.skip();
    }

    /// Returns the announcement of the model to whose upload `command` belongs.
    fn announced(&self, command: &ToDevice) -> ModelBegin {
        match (command, &self.slot) {
            (ToDevice::ModelBegin(begin), _) | (_, Some((begin, _))) => *begin,
            (_, None) => ModelBegin::default(),
        }
    }

    fn model_received(&mut self) -> Vec<u8> {
        let (ModelBegin { crc, .. }, bytes) = self.slot.clone().unwrap();
        let received = ModelReceived { crc, bytes: u32::try_from(bytes.len()).unwrap() };
        self.frame(0, &ToHost::ModelReceived(received))
    }

    pub(crate) fn hello(&mut self) -> Vec<u8> {
        let (model_id, session_id, chip_uid) = (self.model_id, self.session_id, self.chip_uid);
        let mut bytes = self.frame(
            0,
            &ToHost::Hello(Hello {
                firmware: "test",
                board: "board",
                chip_uid,
                model_id,
                session_id,
                reset_cause: ResetCause::PowerOn,
                fault: "",
            }),
        );
        if self.substitutes != Substitutes::NONE {
            bytes.extend(self.frame(0, &ToHost::Substitutes(self.substitutes)));
        }
        let labels = self.labels.clone();
        let zero_point = match self.code_format {
            CodeFormat::Int8 => self.code_zero_point,
            _ => [0; NUMBERS],
        };
        let code_scale = self.code_scale;
        let numbers = if self.has_network { NUMBERS } else { 0 };
        bytes.extend(self.frame(
            0,
            &ToHost::Capabilities(Capabilities {
                adc_rate_hz: 512,
                step_rate_hz: self.step_rate_hz,
                window_steps: 16,
                hop_steps: self.hop_steps,
                channels: self.channels,
                lsb_nv: 22.351_742,
                mains_hz: 50,
                group_delay_us: 10_000,
                labels: &labels,
                filters: "none",
                code_format: self.code_format,
                code_scale: code_scale.into_iter().take(numbers).collect(),
                code_zero_point: zero_point.into_iter().take(numbers).collect(),
            }),
        ));
        bytes
    }

    /// Handles the commands in `bytes`, and returns the frames with which the board answers.
    pub(crate) fn answer(&mut self, mut bytes: &[u8]) -> Vec<u8> {
        let mut answers = Vec::new();
        let mut commands = Vec::new();
        while let Some(outcome) = self.commands.next::<ToDevice>(&mut bytes) {
            // Skip what is no command: a terminal not yet in raw mode echoes the board's answers.
            let Ok(frame) = outcome else { continue };
            if let (ToDevice::ModelChunk(chunk), Some((_, bytes))) = (frame.message, &mut self.slot)
                && chunk.offset as usize == bytes.len()
            {
                bytes.extend(chunk.bytes);
            }
            commands.push((frame.header.seq, frame.message.without_bytes()));
        }
        for (seq, command) in commands {
            self.received.push((seq, command));
            let mut result = AckResult::Done;
            match command {
                ToDevice::Identify => answers.extend(self.hello()),
                ToDevice::Start(start) if !self.supported.contains(start.streams) => {
                    result = AckResult::BadArgument;
                }
                // A `Start` changes nothing while the board is streaming.
                ToDevice::Start(_) if self.streaming => {}
                ToDevice::Start(start) => {
                    self.next_window = 0;
                    self.streams = start.streams;
                    self.streaming = true;
                }
                ToDevice::Stop => {
                    self.streaming = false;
                    answers.extend(self.stats(Streams::empty()));
                }
                ToDevice::Ping | ToDevice::SetFeatures(_) => {}
                ToDevice::SyncTime { host_time_us } if let Some(zero_us) = self.zero_us => {
                    let received_us = host_time_us - zero_us.cast_unsigned();
                    let reading = ToHost::ClockReading(ClockReading { host_time_us, received_us });
                    answers.extend(self.frame(received_us, &reading));
                }
                ToDevice::ModelBegin(_) | ToDevice::ModelChunk(_) | ToDevice::ModelEnd
                    if self.slot.is_none() || self.announced(&command).bytes > LARGEST_MODEL =>
                {
                    result = AckResult::NotSupported;
                }
                ToDevice::ModelBegin(_) | ToDevice::ModelChunk(_) | ToDevice::ModelEnd
                    if self.announced(&command).bytes == 0 =>
                {
                    result = AckResult::BadArgument;
                    answers.extend(self.model_received());
                }
                ToDevice::ModelBegin(begin) => {
                    let announced = self.slot.as_ref().map(|(announced, _)| *announced);
                    if announced != Some(begin) {
                        self.slot = Some((begin, Vec::new()));
                    }
                    answers.extend(self.model_received());
                }
                ToDevice::ModelChunk(_) => answers.extend(self.model_received()),
                ToDevice::ModelEnd => {
                    let (begin, bytes) = self.slot.clone().unwrap();
                    if link::model_crc(&bytes) == begin.crc {
                        self.model_id = begin.id;
                    } else {
                        result = AckResult::Failed;
                        self.slot = Some((ModelBegin::default(), Vec::new()));
                    }
                    answers.extend(self.model_received());
                    if result == AckResult::Done {
                        answers.extend(self.hello());
                    }
                }
                ToDevice::SelfTest
                | ToDevice::SyncTime { .. }
                | ToDevice::Reset(_)
                | ToDevice::SetExclusion(_)
                | ToDevice::SetImpedance { .. } => {
                    result = self.ack_result;
                }
                ToDevice::SetRate { rate } => {
                    if self.supported.contains(Streams::PACKED) {
                        self.rate = rate;
                    } else {
                        result = AckResult::UnknownCommand;
                    }
                }
            }
            let ack = Ack { of: seq, result };
            answers.extend(self.frame(0, &ToHost::Ack(ack)));
            if let ToDevice::Reset(_) = command
                && self.restarts_on_reset
            {
                self.reboot();
                answers.extend(self.hello());
            }
            if let (ToDevice::SelfTest, Some(test)) = (command, self.self_test.clone()) {
                answers.extend(self.frame(0, &ToHost::SelfTest(test)));
            }
        }
        answers
    }

    /// Returns the frame of the next code, made at `device_us`; all its 128 values are `value`.
    pub(crate) fn code(&mut self, device_us: u64, value: i8) -> Vec<u8> {
        self.code_of(device_us, &CodeValues::int8(&[value.cast_unsigned(); NUMBERS]))
    }

    /// Returns a frame with the next code, which has `values` and was made at `device_us`.
    pub(crate) fn code_of(&mut self, device_us: u64, values: &CodeValues) -> Vec<u8> {
        let window = self.next_window;
        self.now_us = device_us;
        self.next_window = window.wrapping_add(1);
        let code = Code {
            model_id: self.model_id,
            window,
            first_sample: u64::from(window) * 32,
            flags: Flags::empty(),
            clipped: 0,
            clipped_values: 0,
            saturated: 0,
            values: *values,
        };
        self.frame(device_us, &ToHost::Code(code))
    }

    pub(crate) fn stats(&mut self, streams: Streams) -> Vec<u8> {
        let next_window = self.next_window;
        self.frame(self.now_us, &ToHost::Stats(Stats { streams, next_window, ..Stats::default() }))
    }
}
