//! The board's behaviour between ADC and port, without time and without a port.

use link::{
    Ack, AckResult, Capabilities, Code as CodeMessage, Counters, Decoder, Encoder, Flags,
    FrameError, Hello, MAX_FRAME, MAX_LABELS_BYTES, MAX_TEXT_BYTES, ResetCause, Start, Stats,
    Streams, ToDevice, ToHost,
};
use pipeline::{Acquisition, Code, Encoder as CodeEncoder, Mains, Sample};

use crate::Outbox;

const _: () = {
    assert!(model::LABELS.len() <= MAX_LABELS_BYTES);
    assert!(model::MAINS_50.description.len() <= MAX_TEXT_BYTES);
    assert!(model::MAINS_60.description.len() <= MAX_TEXT_BYTES);
};

/// Streams that this board has.
const STREAMS: Streams = Streams::CODES;

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
    streams: Streams,
    outbox: Outbox,
    encoder: Encoder,
    decoder: Decoder,
    stats: Stats,
    /// Values that the int8 input clipped before the last `Start`.
    clipped_before: u32,
    /// Code values that were clipped.
    clipped_values: u32,
}

impl VirtualBoard {
    /// A board that has just started: it introduces itself into the outbox.
    pub fn new(identity: Identity, mains: Mains, outbox: Outbox) -> Self {
        let mut board = Self {
            identity,
            mains,
            acquisition: Acquisition::new(mains),
            code_encoder: CodeEncoder::new(),
            streams: Streams::empty(),
            outbox,
            encoder: Encoder::default(),
            decoder: Decoder::new(),
            stats: Stats::default(),
            clipped_before: 0,
            clipped_values: 0,
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
        if let Some(code) = step.and_then(|step| self.code_encoder.push(&step)) {
            self.stats.codes_made = self.stats.codes_made.wrapping_add(1);
            self.stats.next_window = code.window.wrapping_add(1);
            self.clipped_values = self.clipped_values.wrapping_add(code.clipped_values.into());
            self.send(now_us, &ToHost::Code(message(&code)));
        }
        if self
            .stats
            .samples
            .is_multiple_of(u64::from(model::ADC_RATE_HZ))
        {
            self.send_stats(now_us);
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
        self.clipped_before
            .wrapping_add(self.acquisition.clipped())
            .wrapping_add(self.clipped_values)
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
    let clipped = code.clipped.saturating_add(code.clipped_values.into());
    let mut flags = Flags::empty();
    for (set, flag) in [
        (code.saturated > 0, Flags::SATURATED),
        (code.settling, Flags::SETTLING),
        (clipped > 0, Flags::CLIPPED),
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
        clipped,
        values: code.values,
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
mod tests {
    use super::*;
    use crate::WhenFull;

    fn board() -> (VirtualBoard, Outbox) {
        let outbox = Outbox::new(WhenFull::DropOldest);
        let identity = Identity {
            session_id: 7,
            chip_uid: [1; 12],
        };
        let board = VirtualBoard::new(identity, Mains::Hz50, outbox.clone());
        (board, outbox)
    }

    fn send(board: &mut VirtualBoard, host: &mut Encoder, command: ToDevice) {
        let mut buffer = [0; MAX_FRAME];
        let bytes = host
            .encode(0, &command, &mut buffer)
            .expect("a command fits a frame");
        board.receive(bytes, 1_000);
    }

    /// All frames in the outbox, decoded by `look`, with their seq.
    fn frames<T>(outbox: &Outbox, look: impl Fn(ToHost<'_>) -> Option<T>) -> Vec<T> {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let mut seen = Vec::new();
        while !outbox.drain(std::time::Duration::ZERO) {
            let frame = outbox.take().expect("a frame waits");
            outbox.written();
            let mut bytes = &frame[..];
            while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut bytes) {
                seen.extend(look(outcome.expect("the board sends sound frames").message));
            }
        }
        seen
    }

    const START: ToDevice = ToDevice::Start(Start {
        streams: Streams::CODES,
        mains_hz: 0,
    });

    #[test]
    fn a_board_introduces_itself_when_it_starts_and_when_asked() {
        let (mut board, outbox) = board();
        send(&mut board, &mut Encoder::default(), ToDevice::Identify);
        let labels = frames(&outbox, |message| match message {
            ToHost::Capabilities(about) => Some(about.labels.split(' ').count()),
            _ => None,
        });
        assert_eq!(labels, [pipeline::ELECTRODES; 2]);
    }

    #[test]
    fn every_command_is_acknowledged_with_its_seq() {
        let (mut board, outbox) = board();
        let mut host = Encoder::starting_at(40);
        let bad_mains = ToDevice::Start(Start {
            streams: Streams::CODES,
            mains_hz: 55,
        });
        let bad_stream = ToDevice::Start(Start {
            streams: Streams::from_bits(512),
            mains_hz: 0,
        });
        for command in [
            START,
            START,
            ToDevice::Ping,
            bad_mains,
            bad_stream,
            ToDevice::Stop,
        ] {
            send(&mut board, &mut host, command);
        }
        let acks = frames(&outbox, |message| match message {
            ToHost::Ack(ack) => Some((ack.of, ack.result)),
            _ => None,
        });
        let (done, bad) = (AckResult::Done, AckResult::BadArgument);
        assert_eq!(
            acks,
            [
                (40, done),
                (41, done),
                (42, done),
                (43, bad),
                (44, bad),
                (45, done)
            ]
        );
    }

    #[test]
    fn codes_come_only_between_start_and_stop_and_begin_at_window_0() {
        let (mut board, outbox) = board();
        let mut host = Encoder::default();
        let second = |board: &mut VirtualBoard| {
            for _ in 0..512 {
                board.sample(&Sample::default(), 0);
            }
        };
        second(&mut board);
        for command in [START, ToDevice::Stop, START] {
            send(&mut board, &mut host, command);
            second(&mut board);
        }
        let windows = frames(&outbox, |message| match message {
            ToHost::Code(code) => Some(code.window),
            _ => None,
        });
        let per_second = (512 / 4 - 16) / 8 + 1;
        let expected: Vec<u32> = (0..per_second).chain(0..per_second).collect();
        assert_eq!(windows, expected);
    }

    #[test]
    fn a_clipped_value_is_counted_once_though_two_windows_hold_it() {
        let (mut board, outbox) = board();
        let mut host = Encoder::default();
        send(&mut board, &mut host, START);
        for index in 0..512 {
            let mut sample = Sample::default();
            sample.counts[20] = if index == 200 { Sample::MAX } else { 0 };
            board.sample(&sample, 0);
        }
        let marked = frames(&outbox, |message| match message {
            ToHost::Code(code) if code.clipped > 0 => Some(code.clipped),
            _ => None,
        });
        let total: u32 = marked.iter().map(|&clipped| u32::from(clipped)).sum();
        let once = board.acquisition.clipped();
        assert!(
            (1..64).contains(&once),
            "one electrode, while the impulse response lasts"
        );
        assert_eq!(board.stats().clipped - board.clipped_values, once);
        assert!(
            total > board.stats().clipped,
            "overlapping windows count it twice"
        );
    }

    #[test]
    fn damaged_commands_are_counted_and_the_next_one_is_obeyed() {
        let (mut board, outbox) = board();
        board.receive(b"\0noise on the line\0", 0);
        send(&mut board, &mut Encoder::default(), ToDevice::Stop);
        let bad = frames(&outbox, |message| match message {
            ToHost::Stats(stats) => Some((stats.input_bad, stats.commands)),
            _ => None,
        });
        assert_eq!(bad, [(1, 1)]);
    }
}
