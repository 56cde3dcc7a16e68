//! Frames from peers of other releases, and echoes, are refused and never misread.

use link::{
    Ack, AckResult, CodeValues, Decoder, Encoder, ExclusionPolicy, FrameError, Header, MAX_FRAME,
    Message, ModelBegin, ResetCause, Stage, ToDevice, ToHost, VERSION, encode,
};
use serde::{Deserialize, Serialize};

use crate::messages::code_in;

/// `ToDevice` of a later release, which has one more message.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
enum LaterToDevice {
    Start(u8),
    Stop,
    Identify,
    Ping,
    SelfTest,
    SyncTime { host_time_us: u64 },
    Reset(u8),
    SetRate { rate: u8 },
    SetExclusion(ExclusionPolicy),
    ModelBegin(ModelBegin),
    ModelChunk { offset: u32 },
    ModelEnd,
    SetFeatures,
    SetImpedance { on: bool },
    Later { pattern: u8, value: u32 },
}

impl Message<'_> for LaterToDevice {
    const KINDS: u32 = 15;
    const DIRECTION: u8 = ToDevice::DIRECTION;
}

fn first<'d>(
    decoder: &'d mut Decoder,
    mut bytes: &[u8],
) -> Option<Result<link::Frame<ToDevice<'d>>, FrameError>> {
    decoder.next::<ToDevice>(&mut bytes)
}

#[test]
fn a_newer_message_is_an_intact_frame_that_is_ignored() {
    let mut buffer = [0; MAX_FRAME];
    let mut encoder = Encoder::starting_at(7);
    let later = LaterToDevice::Later { pattern: 3, value: 70_000 };
    let bytes = encoder.encode(5, &later, &mut buffer).unwrap();
    let mut decoder = Decoder::new();
    let header = Header { version: VERSION, seq: 7, device_time_us: 5 };
    assert_eq!(first(&mut decoder, bytes), Some(Err(FrameError::Unknown { header, kind: 14 })));
    let bytes = encoder.encode(6, &LaterToDevice::Ping, &mut buffer).unwrap();
    assert_eq!(first(&mut decoder, bytes).unwrap().unwrap().message, ToDevice::Ping);
    let counters = *decoder.counters();
    assert_eq!((counters.unknown, counters.frames), (1, 1));
    assert_eq!((counters.crc, counters.resyncs), (0, 0));
}

#[test]
fn another_version_is_refused_with_its_number() {
    let mut buffer = [0; MAX_FRAME];
    let header = Header { version: 2, seq: 0, device_time_us: 0 };
    let bytes = encode(&header, &ToDevice::Ping, &mut buffer).unwrap();
    let mut decoder = Decoder::new();
    let error = first(&mut decoder, bytes).unwrap().unwrap_err();
    assert_eq!(error, FrameError::Version(2));
    assert!(error.to_string().contains("same release"), "{error}");
    assert_eq!(decoder.counters().version, 1);
}

#[test]
fn an_echo_is_refused_in_the_other_direction() {
    let mut buffer = [0; MAX_FRAME];
    let mut encoder = Encoder::default();
    let ack = ToHost::Ack(Ack { of: 3, result: AckResult::Done });
    let stats = ToHost::Stats(link::Stats::default());
    let code = ToHost::Code(code_in(CodeValues::int8(&[0; 128])));
    let mut device = Decoder::new();
    for message in [ack, stats, code] {
        let echo = encoder.encode(1, &message, &mut buffer).unwrap();
        assert_eq!(first(&mut device, echo), Some(Err(FrameError::Crc)));
    }
    let mut host = Decoder::<MAX_FRAME>::new();
    let start = ToDevice::Start(link::Start { streams: link::Streams::CODES, mains_hz: 50 });
    for command in [start, ToDevice::Stop, ToDevice::Identify, ToDevice::Ping] {
        let mut echo = encoder.encode(0, &command, &mut buffer).unwrap();
        assert_eq!(host.next::<ToHost>(&mut echo), Some(Err(FrameError::Crc)));
    }
}

/// Returns whether a host accepts `message`. Asserts that the host decodes an accepted message as
/// it was sent, and refuses any other as malformed.
fn is_accepted(message: &ToHost<'_>) -> bool {
    let mut buffer = [0; MAX_FRAME];
    let mut bytes = Encoder::default().encode(1, message, &mut buffer).unwrap();
    let mut host = Decoder::<MAX_FRAME>::new();
    match host.next::<ToHost>(&mut bytes).unwrap() {
        Ok(frame) => assert_eq!(&frame.message, message),
        Err(error) => {
            assert_eq!(error, FrameError::Malformed);
            return false;
        }
    }
    true
}

#[test]
fn a_code_with_an_exponent_above_the_maximum_is_malformed() {
    for exponent in 0..=u8::MAX {
        let code = code_in(CodeValues::int8_exponent(exponent, &[128; 128]));
        let is_accepted = is_accepted(&ToHost::Code(code));
        assert_eq!(is_accepted, exponent <= link::MAX_EXPONENT);
    }
}

#[test]
fn a_code_has_1_to_256_whole_values() {
    let bytes = [7; 2 * link::MAX_NUMBERS + 2];
    let accepted =
        |values: CodeValues| is_accepted(&ToHost::Code(code_in(values))).then_some(values.len());
    for (length, expected) in [(0, None), (1, Some(1)), (8, Some(8)), (256, Some(256)), (257, None)]
    {
        assert_eq!(accepted(CodeValues::int8(&bytes[..length])), expected);
        let exponent = CodeValues::int8_exponent(3, &bytes[..length]);
        assert_eq!(accepted(exponent), expected);
    }
    for (length, expected) in
        [(0, None), (1, None), (2, Some(1)), (17, None), (512, Some(256)), (514, None)]
    {
        assert_eq!(accepted(CodeValues::int16(&bytes[..length])), expected);
    }
}

#[test]
fn an_audit_has_0_to_256_values() {
    let bytes = [7; link::MAX_NUMBERS + 1];
    for (length, fits) in [(0, true), (1, true), (256, true), (257, false)] {
        let audit = ToHost::Audit(link::Audit {
            model_id: [1; 8],
            window: 0,
            planes: &[1, 2, 3],
            values: CodeValues::int8(&bytes[..length]),
        });
        assert_eq!(is_accepted(&audit), fits);
    }
}

#[test]
fn impedances_are_those_of_1_to_64_electrodes() {
    let bytes = [7; 4 * (link::MAX_ELECTRODES + 1)];
    for (length, fits) in [(0, false), (3, false), (4, true), (9, false), (256, true), (260, false)]
    {
        let impedance = ToHost::Impedance(link::Impedance { ohms: &bytes[..length] });
        assert_eq!(is_accepted(&impedance), fits, "{length}");
    }
}

#[test]
fn levels_span_the_range_of_their_format() {
    let ends = |values: CodeValues| {
        let levels: Vec<i32> = values.levels().collect();
        assert_eq!(values.len(), levels.len());
        let [least, .., greatest] = levels[..] else { panic!("{levels:?}") };
        assert_eq!(values.format().range(), Some([least, greatest]));
    };
    let values = [i8::MIN, 0, i8::MAX].map(i8::cast_unsigned);
    ends(CodeValues::int8(&values));
    ends(CodeValues::int8_exponent(link::MAX_EXPONENT, &values));
    let values = [i16::MIN, 0, i16::MAX].map(i16::to_le_bytes);
    ends(CodeValues::int16(values.as_flattened()));
}

#[test]
fn unknown_reasons_keep_their_number() {
    for byte in 0..=u8::MAX {
        assert_eq!(u8::from(AckResult::from(byte)), byte);
        assert_eq!(u8::from(ResetCause::from(byte)), byte);
        assert_eq!(u8::from(link::CodeFormat::from(byte)), byte);
        assert_eq!(u8::from(Stage::from(byte)), byte);
        assert_eq!(u8::from(link::BlockForm::from(byte)), byte);
    }
    assert_eq!(AckResult::from(200), AckResult::Newer(200));
}
