//! Valid frames whose fields hold extreme numbers, as no working device sends them.

use bridge_core::{AuditedWindow, Core, Effects, EventPlace, FillerPolicy};
use link::{
    Audit, BlockForm, ClockReading, CodeValues, CompressedRaw, Converters, Event, EventKind,
    Filtered, Flags, PackedCode, Raw, Streams, ToHost,
};
use neuro_ros::{NeuroEvent, NeuroFrame};

use crate::board::{Board, Noise, at, model};
use crate::recorder::SETTINGS;

/// Keeps the bytes for the device, and counts published frames and events.
#[derive(Default)]
struct Counter {
    sent: Vec<u8>,
    published: usize,
}

impl Effects for Counter {
    fn send(&mut self, frame: &[u8]) {
        self.sent.extend_from_slice(frame);
    }

    fn publish_encoded(&mut self, _: &NeuroFrame) {
        self.published += 1;
    }

    fn publish_raw(&mut self, _: &NeuroFrame) {
        self.published += 1;
    }

    fn publish_filtered(&mut self, _: &NeuroFrame) {
        self.published += 1;
    }

    fn publish_event(&mut self, _: &NeuroEvent, _: EventPlace) {
        self.published += 1;
    }

    fn audit(&mut self, window: AuditedWindow) {
        let result = window.compare(&model());
        assert!(result.is_none_or(|result| result.rms.is_finite()));
    }
}

/// Numbers to try in every field: limits of integer types, numbers near a wrap, and some between.
const NUMBERS: [u64; 10] =
    [0, 1, 31, 1_000, 100_000, 1 << 31, 1 << 32, 1 << 63, u64::MAX - 8, u64::MAX];

#[test]
fn extreme_numbers_in_valid_frames_do_not_panic_or_stop_the_codes() {
    for filler in [FillerPolicy::Last, FillerPolicy::Off] {
        survives_extreme_numbers(filler);
    }
}

fn survives_extreme_numbers(filler: FillerPolicy) {
    let settings = bridge_core::Settings { filler, streams: Streams::ALL, ..SETTINGS };
    let mut core = Core::new(settings, Some(model()));
    let (mut board, mut counter) = (Board::new(), Counter::default());
    let mut now_us = 1_000_000;
    core.connected(at(now_us), &mut counter);
    while !counter.sent.is_empty() {
        let answers = board.answer(&std::mem::take(&mut counter.sent));
        core.receive(&answers, at(now_us), &mut counter);
    }
    let (bytes, planes) = ([0x80; 1536], [0x80; 1440]);
    let mut noise = Noise(1);
    let mut draw = |below: usize| noise.bits() as usize % below;
    for _ in 0..400 {
        now_us += 1_000;
        let mut number = || NUMBERS[draw(NUMBERS.len())];
        let (made_us, first, other) = (number(), number(), number());
        #[expect(clippy::cast_possible_truncation, reason = "any number serves")]
        let (small, byte) = (other as u32, first as u8);
        let message = match draw(8) {
            0 => ToHost::Raw(Raw {
                first_sample: first,
                channels: 64,
                flags: Flags::from_bits(u16::MAX),
                counts: &bytes[..192 * draw(9)],
            }),
            1 => ToHost::Filtered(Filtered {
                first_step: first,
                electrodes: 61,
                fraction_bits: byte,
                flags: Flags::from_bits(u16::MAX),
                values: &bytes[..244 * draw(5)],
            }),
            2 => ToHost::Event(Event {
                kind: EventKind::from(byte % 3),
                number: small,
                sample: first,
            }),
            3 => ToHost::Converters(Converters {
                drdy_millihertz: small,
                off_positive: first,
                off_negative: other,
                frames_bad: [small; 8].into_iter().collect(),
                ..Converters::default()
            }),
            4 => ToHost::ClockReading(ClockReading { host_time_us: first, received_us: other }),
            5 => ToHost::CompressedRaw(CompressedRaw {
                first_sample: first,
                channels: 64,
                flags: Flags::from_bits(u16::MAX),
                form: BlockForm::from(byte % 4),
                samples: byte,
                bytes: &bytes[..192 * draw(9)],
            }),
            6 => ToHost::PackedCode(PackedCode {
                block: small,
                rate: byte,
                flags: Flags::from_bits(u16::MAX),
                clipped: u16::MAX,
                saturated: other,
                bytes: &bytes[..draw(200)],
            }),
            _ => ToHost::Audit(Audit {
                model_id: board.model_id,
                window: small,
                planes: &planes,
                values: CodeValues::int8(&[0x80; 128]),
            }),
        };
        let frame = board.frame(made_us, &message);
        core.receive(&frame, at(now_us), &mut counter);
        if draw(20) == 0 {
            core.diagnostics(at(now_us));
        }
    }
    let before = core.summary().received;
    now_us += 62_500;
    let code = board.code(now_us.unsigned_abs(), 1);
    core.receive(&code, at(now_us), &mut counter);
    assert_eq!(core.summary().received, before + 1);
    assert!(counter.published > 0);
}
