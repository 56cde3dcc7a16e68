//! Samples, events, warnings and errors from synthetic GDF files.

use recordings::{Event, EventLabel, Format, Ratio, RecordingError, Warning};

use crate::{
    gdf_file::{GdfFile, GdfSignal},
    open, read_all,
};

/// Encodes an event table of mode 1 from (position, type) pairs.
pub(crate) fn event_table(rate_hz: f32, events: &[(u32, u16)]) -> Vec<u8> {
    let count = u32::try_from(events.len())
        .expect("few events")
        .to_le_bytes();
    let mut table = vec![1, count[0], count[1], count[2]];
    table.extend(rate_hz.to_le_bytes());
    table.extend(
        events
            .iter()
            .flat_map(|(position, _)| position.to_le_bytes()),
    );
    table.extend(events.iter().flat_map(|(_, label)| label.to_le_bytes()));
    table
}

#[test]
fn signals_of_all_sample_types_are_read_from_one_file() {
    let signals = vec![
        GdfSignal::with_type(1, 1, vec![0xf6, 10]),
        GdfSignal::with_type(2, 2, vec![1, 2, 3, 200]),
        GdfSignal::with_type(
            3,
            1,
            [-300_i16, 300]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        ),
        GdfSignal::with_type(
            4,
            1,
            [1_u16, 65535]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        ),
        GdfSignal::with_type(
            5,
            1,
            [-70000_i32, 7]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        ),
        GdfSignal::with_type(
            6,
            1,
            [u32::MAX, 7].iter().flat_map(|v| v.to_le_bytes()).collect(),
        ),
        GdfSignal::with_type(
            7,
            1,
            [-1_i64, 7].iter().flat_map(|v| v.to_le_bytes()).collect(),
        ),
        GdfSignal::with_type(
            8,
            1,
            [1_u64, 7].iter().flat_map(|v| v.to_le_bytes()).collect(),
        ),
        GdfSignal::with_type(
            16,
            1,
            [0.5_f32, -7.25]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        ),
        GdfSignal::with_type(
            17,
            1,
            [0.1_f64, 7.0]
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        ),
        GdfSignal::with_type(279, 1, vec![0, 0, 0x80, 1, 0, 0]),
        GdfSignal::with_type(535, 1, vec![0, 0, 0x80, 1, 0, 0]),
    ];
    let mut recording = open(GdfFile::version_2(2, signals).bytes()).expect("a valid file");
    let samples = read_all(&mut recording);
    let expected: [&[f64]; 12] = [
        &[-10.0, 10.0],
        &[1.0, 2.0, 3.0, 200.0],
        &[-300.0, 300.0],
        &[1.0, 65535.0],
        &[-70000.0, 7.0],
        &[4_294_967_295.0, 7.0],
        &[-1.0, 7.0],
        &[1.0, 7.0],
        &[0.5, -7.25],
        &[0.1, 7.0],
        &[-8_388_608.0, 1.0],
        &[8_388_608.0, 1.0],
    ];
    for (signal, (found, expected)) in samples.iter().zip(expected).enumerate() {
        // The calibration (d + 100) * 1 - 100 is exact for integers and changes 0.1 by less than 1e-14.
        let close = found
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() <= 1e-9);
        assert!(
            close && found.len() == expected.len(),
            "signal {signal}: {found:?}"
        );
    }
}

#[test]
fn the_third_header_is_skipped_and_the_event_table_is_found() {
    let mut file = GdfFile::version_2(2, vec![GdfSignal::float32("Cz", 2, &[1.0, 2.0, 3.0, 4.0])]);
    file.third_header = b"\x01\x05\0\0text\0".to_vec();
    file.events = event_table(2.0, &[(1, 768), (4, 0x8300)]);
    file.duration = (1, 2);
    let mut recording = open(file.bytes()).expect("a valid file");
    assert_eq!(recording.format(), Format::Gdf2(2.2));
    assert_eq!(recording.signals()[0].rate.map(Ratio::value), Some(4.0));
    let event = |onset_s, label| Event {
        onset_s,
        duration_s: None,
        signal: None,
        label: EventLabel::Type(label),
    };
    assert_eq!(
        recording.events().expect("readable"),
        [event(0.0, 768), event(1.5, 0x8300)]
    );
    assert_eq!(read_all(&mut recording)[0], [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(recording.warnings(), []);
}

#[test]
fn a_truncated_event_table_causes_a_warning_and_the_samples_are_read() {
    let mut file = GdfFile::version_2(1, vec![GdfSignal::float32("Cz", 1, &[1.0])]);
    file.events = event_table(1.0, &[(1, 768), (2, 769)]);
    file.events.truncate(15);
    let mut recording = open(file.bytes()).expect("usable");
    assert_eq!(recording.events().expect("readable"), []);
    assert_eq!(
        recording.warnings(),
        [Warning::EventTable {
            announced: 2,
            bytes: 15
        }]
    );
    assert_eq!(read_all(&mut recording)[0], [1.0]);
}

#[test]
fn the_layout_of_version_1_is_read() {
    let mut signal = GdfSignal::with_type(3, 2, vec![0, 1, 100, 0, 0x9c, 0xff, 0, 0]);
    signal.ranges = [-1.0, 1.0, -100.0, 100.0];
    signal.unit = "mV";
    let mut file = GdfFile::version_2(2, vec![signal]);
    file.version_1 = true;
    file.events = vec![1, 2, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, 5, 3];
    let mut recording = open(file.bytes()).expect("a valid file");
    assert_eq!(recording.format(), Format::Gdf1(1.25));
    assert_eq!(recording.signals()[0].unit.microvolts(), Some(1000.0));
    let samples = &read_all(&mut recording)[0];
    assert_eq!(samples[1..], [1.0, -1.0, 0.0]);
    let events = recording.events().expect("readable");
    assert_eq!(
        (events[0].onset_s, events[0].label.clone()),
        (1.0, EventLabel::Type(0x0305))
    );
}

#[test]
fn unknown_record_counts_truncation_and_unknown_units_cause_warnings() {
    let mut file = GdfFile::version_2(-1, vec![GdfSignal::float32("Cz", 1, &[1.0, 2.0])]);
    file.signals[0].unit_code = 512;
    file.signals[0].unit = "";
    let mut bytes = file.bytes();
    bytes.push(0);
    let recording = open(bytes).expect("usable");
    assert_eq!(
        recording.warnings(),
        [
            Warning::UnitUnknown {
                signals: vec!["Cz (code 512)".to_owned()]
            },
            Warning::RecordsUnknown { derived: 2 },
            Warning::Truncated {
                promised: 2,
                whole: 2,
                left_over: 1
            },
        ]
    );
}

#[test]
fn unusable_headers_are_refused() {
    let valid = || GdfFile::version_2(1, vec![GdfSignal::float32("Cz", 1, &[1.0])]);
    let mut packed = valid();
    packed.signals[0].type_number = 255 + 12;
    assert!(matches!(
        open(packed.bytes()),
        Err(RecordingError::SampleType { number: 267, .. })
    ));
    let mut flat = valid();
    flat.signals[0].ranges[2] = 100.0;
    assert!(matches!(
        open(flat.bytes()),
        Err(RecordingError::Range { .. })
    ));
    let mut not_a_number = valid();
    not_a_number.signals[0].ranges[0] = f64::NAN;
    assert!(matches!(
        open(not_a_number.bytes()),
        Err(RecordingError::Range { .. })
    ));
    let mut zero_denominator = valid();
    zero_denominator.duration = (1, 0);
    assert!(matches!(
        open(zero_denominator.bytes()),
        Err(RecordingError::HeaderField { .. })
    ));
    let mut bytes = valid().bytes();
    bytes[252..254].copy_from_slice(&0_u16.to_le_bytes());
    assert!(matches!(
        open(bytes.clone()),
        Err(RecordingError::HeaderField { .. })
    ));
    bytes[252..254].copy_from_slice(&u16::MAX.to_le_bytes());
    assert!(matches!(
        open(bytes),
        Err(RecordingError::HeaderTruncated { .. })
    ));
    let mut short_header = valid().bytes();
    short_header[184] = 1;
    assert!(matches!(
        open(short_header),
        Err(RecordingError::HeaderField { .. })
    ));
    let mut unknown_version = valid().bytes();
    unknown_version[4] = b'9';
    assert!(matches!(
        open(unknown_version),
        Err(RecordingError::UnknownFormat { .. })
    ));
}
