//! Random messages of every kind.

use core::iter;

use link::{
    CodeValues, Flags, MAX_ELECTRODES, MAX_EXPONENT, MAX_FEATURES, MAX_NUMBERS, MAX_STAGES, Stats,
    Streams, ToHost,
};
use proptest::prelude::*;

use crate::messages;

/// Random code values in a random format.
fn values() -> impl Strategy<Value = CodeValues<'static>> {
    let bytes = || {
        let bytes = prop::collection::vec(any::<u8>(), 1..=MAX_NUMBERS);
        bytes.prop_map(|bytes| &*bytes.leak())
    };
    let int8 = bytes().prop_map(CodeValues::int8);
    let exponent = (0..=MAX_EXPONENT, bytes())
        .prop_map(|(exponent, values)| CodeValues::int8_exponent(exponent, values));
    let int16 = prop::collection::vec(any::<[u8; 2]>(), 1..=MAX_NUMBERS)
        .prop_map(|values| CodeValues::int16(values.leak().as_flattened()));
    prop_oneof![int8, exponent, int16]
}

pub(crate) fn message() -> impl Strategy<Value = ToHost<'static>> {
    let messages: Vec<_> = messages::all().into_iter().map(|(_, _, message)| message).collect();
    let bytes = prop::collection::vec(any::<u8>(), 0..=1_536).prop_map(|bytes| &*bytes.leak());
    let numbers = any::<(u8, u16, u32, u64)>();
    (prop::sample::select(messages), bytes, values(), numbers).prop_map(
        |(message, bytes, values, numbers)| with_contents(message, bytes, values, numbers),
    )
}

/// Returns `message` with these contents and numbers in its fields. Enums and sets of bits can get
/// values that this version does not know.
fn with_contents(
    mut message: ToHost<'static>,
    bytes: &'static [u8],
    code_values: CodeValues<'static>,
    (byte, short, word, long): (u8, u16, u32, u64),
) -> ToHost<'static> {
    let bits = Flags::from_bits(short);
    match &mut message {
        ToHost::Capabilities(_) | ToHost::Converters(_) | ToHost::SelfTest(_) => {}
        ToHost::Hello(hello) => {
            hello.firmware = "0.1.0 é";
            hello.session_id = word;
            hello.reset_cause = byte.into();
        }
        ToHost::Code(code) => {
            code.model_id = long.to_le_bytes();
            code.window = word;
            code.first_sample = long;
            code.flags = bits;
            code.clipped = !short;
            code.clipped_values = byte;
            code.saturated = !long;
            code.values = code_values;
        }
        ToHost::Stats(stats) => {
            stats.streams = Streams::from_bits(short);
            stats.samples = long;
            set_counts(stats, word);
        }
        ToHost::Ack(ack) => {
            ack.of = word;
            ack.result = byte.into();
        }
        ToHost::Quality(quality) => {
            let mut electrode = quality.electrodes[0];
            electrode.rms_uv = f32::from(short);
            electrode.samples_at_rail = short;
            let electrodes = usize::from(byte) % (MAX_ELECTRODES + 1);
            quality.first_sample = long;
            quality.electrodes = iter::repeat_n(electrode, electrodes).collect();
        }
        ToHost::Timing(timing) => {
            let mut stage = timing.stages[0];
            stage.stage = byte.into();
            stage.histogram[8] = word;
            let stages = usize::from(byte) % (MAX_STAGES + 1);
            timing.stages = iter::repeat_n(stage, stages).collect();
        }
        ToHost::Raw(raw) => {
            raw.first_sample = long;
            raw.channels = byte;
            raw.flags = bits;
            raw.counts = bytes;
        }
        ToHost::Filtered(filtered) => {
            filtered.first_step = long;
            filtered.electrodes = byte;
            filtered.flags = bits;
            filtered.values = bytes;
        }
        ToHost::Audit(audit) => {
            audit.window = word;
            audit.planes = bytes;
            audit.values = code_values;
        }
        ToHost::Event(event) => {
            event.kind = byte.into();
            event.number = word;
            event.sample = long;
        }
        ToHost::ClockReading(reading) => reading.host_time_us = long,
        ToHost::Substitutes(substitutes) => substitutes.zero = long,
        ToHost::CompressedRaw(compressed) => {
            compressed.first_sample = long;
            compressed.channels = byte;
            compressed.flags = bits;
            compressed.form = byte.into();
            compressed.samples = !byte;
            compressed.bytes = bytes;
        }
        ToHost::PackedCode(code) => {
            code.block = word;
            code.rate = byte;
            code.flags = bits;
            code.clipped = !short;
            code.saturated = long;
            code.bytes = bytes;
        }
        ToHost::Exclusion(exclusion) => {
            exclusion.excluded = long;
            exclusion.policy.always = !long;
            exclusion.policy.automatic = byte % 2 == 1;
        }
        ToHost::ModelReceived(received) => received.crc = word,
        ToHost::Features(features) => {
            let levels = code_values.bytes();
            features.hop = word;
            features.flags = bits;
            features.saturated = long;
            features.levels = &levels[..levels.len().min(MAX_FEATURES)];
        }
        ToHost::Impedance(impedance) => impedance.ohms = ohms(code_values.bytes()),
    }
    message
}

/// Returns the bytes of the whole impedances in `bytes`, of at most [`MAX_ELECTRODES`], or a fixed
/// impedance if `bytes` holds no whole one.
fn ohms(bytes: &'static [u8]) -> &'static [u8] {
    let length = bytes.len().min(4 * MAX_ELECTRODES) / 4 * 4;
    if length > 0 { &bytes[..length] } else { &[1, 2, 3, 4] }
}

/// Gives each count a different value.
fn set_counts(stats: &mut Stats, word: u32) {
    let turned = |bits| word.rotate_left(bits);
    stats.next_window = word;
    stats.codes_made = turned(3);
    stats.frames_dropped = turned(6);
    stats.overruns = turned(9);
    stats.adc_status_bad = turned(12);
    stats.clipped = turned(15);
    stats.clipped_values = turned(18);
    stats.commands = turned(21);
    stats.input_bad = turned(24);
}
