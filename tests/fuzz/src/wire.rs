//! Fuzz targets for the bytes that arrive over the link: frames at the bridge, and commands at a
//! device.

use std::sync::{Arc, LazyLock};

use bridge_core::{Core, Effects, EventPlace, HostTime, Model, Settings, TimedPackedBlock};
use crc::{CRC_32_ISCSI, Crc};
use host_sim::{Identity, Outbox, VirtualBoard, WhenFull};
use link::{
    BandPass, Decoder, Encoder, FeatureFilters, MAX_FRAME, Message, ResetInto, Start, Streams,
    ToDevice, ToHost,
};
use neuro_ros::{NeuroEvent, NeuroFrame};
use pipeline::{Mains, Sample};

use crate::Outcome;

/// Time between two samples of the board, microseconds, rounded down.
const PERIOD_US: u64 = 1_000_000 / model::ADC_RATE_HZ as u64;

/// Returns what a board sends in the first 1.5 s after it has started all streams, and after it has
/// started codes, raw samples or packed blocks alone.
pub(crate) fn frame_seeds() -> Vec<Vec<u8>> {
    static SEEDS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
        let runs = [Streams::ALL, Streams::CODES, Streams::RAW, Streams::PACKED];
        runs.map(stream).into()
    });
    SEEDS.clone()
}

/// Returns what a board sends in the first 1.5 s after it has started `streams`.
pub(crate) fn stream(streams: Streams) -> Vec<u8> {
    let outbox = Outbox::new(WhenFull::Wait);
    let mut board = VirtualBoard::new(Identity::default(), Mains::Hz50, outbox.clone());
    let mut commands = Encoder::starting_at(0);
    let start = ToDevice::Start(Start { streams, mains_hz: 50 });
    let measure = ToDevice::SetImpedance { on: true };
    for command in [ToDevice::Identify, ToDevice::SetFeatures(FILTERS), measure, start] {
        board.receive(&frame(&mut commands, &command), 0);
    }
    for number in 0..u64::from(model::ADC_RATE_HZ) * 3 / 2 {
        let noise = |channel: usize| {
            let mixed = (number * 7919 + channel as u64 * 104_729) % 4001;
            i32::try_from(mixed).unwrap_or(0) - 2000
        };
        let counts = std::array::from_fn(noise);
        board.process_sample(&Sample { counts }, number * PERIOD_US);
    }
    outbox.take_all().concat()
}

/// A spatial filter of the built-in montage, with a band-pass.
const FILTERS: FeatureFilters<'_> =
    FeatureFilters { id: 1, first: BAND, second: BAND, weights: &[16; model::ELECTRODES] };
const BAND: BandPass = BandPass { gain: 1 << 30, a1: 1 << 31, a2: -(1 << 31) };

/// Returns the commands of a host that uses everything a device offers.
pub(crate) fn command_seeds() -> Vec<Vec<u8>> {
    let start = |streams, mains_hz| ToDevice::Start(Start { streams, mains_hz });
    let commands = [
        ToDevice::Identify,
        ToDevice::Ping,
        start(Streams::ALL, 60),
        ToDevice::SyncTime { host_time_us: u64::MAX },
        ToDevice::SetFeatures(FILTERS),
        ToDevice::SetImpedance { on: true },
        ToDevice::SelfTest,
        start(Streams::CODES, 0),
        ToDevice::Stop,
        ToDevice::Reset(ResetInto::Firmware),
    ];
    let mut encoder = Encoder::starting_at(0);
    let frames = commands.iter().map(|command| frame(&mut encoder, command));
    vec![frames.collect::<Vec<_>>().concat()]
}

fn frame<'m>(encoder: &mut Encoder, message: &impl Message<'m>) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let frame = encoder.encode(0, message, &mut buffer);
    frame.expect("a message within its limits").to_vec()
}

/// Returns the bytes with a valid CRC in each frame, so that a mutation passes the CRC check. The
/// messages have the direction `direction`. Bytes outside frames stay as they are.
fn sealed(bytes: &[u8], direction: u8) -> Vec<u8> {
    let crc = Crc::<u32>::new(&CRC_32_ISCSI);
    let mut sealed = vec![0];
    for piece in bytes.split(|byte| *byte == 0) {
        let mut body = piece.to_vec();
        match cobs::decode_in_place(&mut body) {
            Ok(length) if length > 4 => {
                body.truncate(length - 4);
                let mut digest = crc.digest();
                digest.update(&[direction]);
                digest.update(&body);
                body.extend(digest.finalize().to_le_bytes());
                let mut frame = vec![0; cobs::max_encoding_length(body.len())];
                let length = cobs::encode(&body, &mut frame);
                sealed.extend_from_slice(&frame[..length]);
            }
            _ => sealed.extend_from_slice(piece),
        }
        sealed.push(0);
    }
    sealed
}

/// Host that checks every frame that the core publishes.
#[derive(Debug, Default)]
struct Host {
    sent: Vec<u8>,
    published: u32,
}

impl Host {
    fn check(&mut self, frame: &NeuroFrame) {
        self.published += 1;
        for (signals, numbers) in [
            (&frame.eeg.info, frame.eeg.data.len()),
            (&frame.exg.info, frame.exg.data.len()),
            (&frame.tri.info, frame.tri.data.len()),
        ] {
            assert_eq!(signals.nsamples as usize * signals.nchannels as usize, numbers);
        }
    }
}

impl Effects for Host {
    fn send(&mut self, frame: &[u8]) {
        self.sent.extend_from_slice(frame);
    }

    fn publish_encoded(&mut self, frame: &NeuroFrame) {
        self.check(frame);
    }

    fn publish_raw(&mut self, frame: &NeuroFrame) {
        self.check(frame);
    }

    fn publish_filtered(&mut self, frame: &NeuroFrame) {
        self.check(frame);
    }

    fn publish_event(&mut self, _: &NeuroEvent, _: EventPlace) {
        self.published += 1;
    }

    fn decode_block(&mut self, _: TimedPackedBlock) {
        self.published += 1;
    }

    fn max_fillers(&self) -> u64 {
        16
    }
}

/// Passes the bytes to the bridge's core in parts of 1,000 bytes, 10 ms apart: unchanged, and with
/// a valid CRC in each frame. The core must count every byte, and each published frame must have
/// the size that it states.
pub(crate) fn frames(bytes: &[u8]) -> Outcome {
    let raw = read_frames(bytes);
    let sealed = read_frames(&sealed(bytes, ToHost::DIRECTION));
    Outcome::accepted_if(raw | sealed)
}

/// Returns whether the core published anything.
fn read_frames(bytes: &[u8]) -> bool {
    static MODEL: LazyLock<Arc<Model>> =
        LazyLock::new(|| Arc::new(Model::embedded().expect("the model")));
    let settings = Settings { streams: Streams::ALL, ..Settings::default() };
    let mut core = Core::new(settings, Some(Arc::clone(&MODEL)));
    let mut host = Host::default();
    let at = |us| HostTime { monotonic_us: us, wall_ns: us * 1000 };
    core.connected(at(0), &mut host);
    let mut now_us = 0;
    for piece in bytes.chunks(1000) {
        now_us += 10_000;
        core.receive(piece, at(now_us), &mut host);
    }
    let counters = core.wire_counters();
    assert_eq!(usize::try_from(counters.bytes), Ok(bytes.len()));
    for status in core.diagnostics(at(now_us)).status {
        assert!(!status.message.is_empty(), "{status:?}");
    }
    assert!(!core.summary().to_string().is_empty());
    host.published > 0
}

/// Passes the bytes to a streaming virtual board: unchanged, and with a valid CRC in each frame.
/// All that the board sends must be frames.
pub(crate) fn commands(bytes: &[u8]) -> Outcome {
    let raw = read_commands(bytes);
    let sealed = read_commands(&sealed(bytes, ToDevice::DIRECTION));
    Outcome::accepted_if(raw | sealed)
}

/// Passes the bytes to a streaming virtual board. Returns whether the board answered a command.
fn read_commands(bytes: &[u8]) -> bool {
    let outbox = Outbox::new(WhenFull::Wait);
    let mut board = VirtualBoard::new(Identity::default(), Mains::Hz50, outbox.clone());
    for (number, piece) in (0..).zip(bytes.chunks(10)) {
        board.receive(piece, number * PERIOD_US);
        board.process_sample(&Sample::default(), number * PERIOD_US);
    }
    let sent = outbox.take_all().concat();
    let mut sent = &sent[..];
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let mut answers = 0;
    while let Some(frame) = decoder.next::<ToHost>(&mut sent) {
        let frame = frame.expect("a device sends whole frames");
        answers += u32::from(matches!(frame.message, ToHost::Ack(_)));
    }
    answers > 0
}
