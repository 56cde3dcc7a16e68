//! Tests samples, events, warnings and errors of synthetic GDF files, and the number of records
//! that the reader finds if the header states -1.

use recordings::{Event, EventLabel, Format, Ratio, RecordingError, Warning};

use crate::{
    event,
    files::{GdfFile, GdfSignal, event_table},
    open, read_all,
    real_files::data,
};

#[test]
fn the_third_header_is_skipped_and_the_event_table_is_found() {
    let mut file = GdfFile::float32(2, 2, &[1.0, 2.0, 3.0, 4.0]);
    file.third_header = b"\x01\x05\0\0text\0".to_vec();
    file.events = event_table(2.0, &[(1, 768), (4, 0x8300)]);
    file.duration = (1, 2);
    let mut recording = open(file.bytes()).expect("a valid file");
    assert_eq!(recording.format(), Format::Gdf2(2.2));
    assert_eq!(recording.signals()[0].rate.map(Ratio::value), Some(4.0));
    let event = |onset_s, kind| event(onset_s, None, EventLabel::Type(kind));
    let expected = [event(0.0, 768), event(1.5, 0x8300)];
    assert_eq!(recording.events().expect("readable"), expected);
    assert_eq!(read_all(&mut recording)[0], [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(recording.warnings(), []);
}

#[test]
fn a_truncated_event_table_causes_a_warning_and_the_samples_are_read() {
    let mut file = GdfFile::float32(1, 1, &[1.0]);
    file.events = event_table(1.0, &[(1, 768), (2, 769)]);
    file.events.truncate(15);
    let mut recording = open(file.bytes()).expect("usable");
    assert_eq!(recording.events().expect("readable"), []);
    let (announced, bytes) = (2, 15);
    let cut_off = Warning::EventTable { announced, bytes };
    assert_eq!(recording.warnings(), [cut_off]);
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
    for records in [2, -1] {
        file.records = records;
        let mut recording = open(file.bytes()).expect("a valid file");
        assert_eq!(recording.format(), Format::Gdf1(1.25));
        assert_eq!(recording.records(), 2);
        assert_eq!(recording.signals()[0].unit.microvolts(), Some(1000.0));
        let samples = &read_all(&mut recording)[0];
        assert_eq!(samples[1..], [1.0, -1.0, 0.0]);
        let expected = [event(1.0, None, EventLabel::Type(0x0305))];
        assert_eq!(recording.events().expect("readable"), expected);
    }
}

#[test]
fn each_signal_of_a_file_has_its_own_unit() {
    let signal = |label, unit, unit_code| GdfSignal {
        label,
        unit,
        unit_code,
        ..GdfSignal::with_type(3, 1, vec![1, 0])
    };
    // 4275, 4274 and 4256 are the ISO/IEEE 11073 codes of microvolt, millivolt and volt.
    let signals =
        vec![signal("Fp1", "uV", 4275), signal("Cz", "mV", 4274), signal("Oz", "V", 4256)];
    let mut file = GdfFile::version_2(1, signals);
    for version_1 in [false, true] {
        file.version_1 = version_1;
        let recording = open(file.bytes()).expect("a valid file");
        let units: Vec<_> =
            recording.signals().iter().map(|signal| signal.unit.microvolts()).collect();
        let expected = [Some(1.0), Some(1e3), Some(1e6)];
        assert_eq!(units, expected, "version 1: {version_1}");
    }
}

#[test]
fn unknown_record_counts_truncation_and_unknown_units_cause_warnings() {
    let mut file = GdfFile::float32(-1, 1, &[1.0, 2.0]);
    file.signals[0].unit_code = 512;
    file.signals[0].unit = "";
    let mut bytes = file.bytes();
    bytes.push(0);
    let recording = open(bytes).expect("usable");
    assert_eq!(
        recording.warnings(),
        [
            Warning::UnitUnknown { signals: vec!["Cz (code 512)".to_owned()] },
            Warning::RecordsUnknown { derived: 2 },
            Warning::Truncated { promised: 2, whole: 2, left_over: 1 },
        ]
    );
}

#[test]
fn unusable_headers_are_refused() {
    let valid = || GdfFile::float32(1, 1, &[1.0]);
    let mut packed = valid();
    packed.signals[0].type_number = 255 + 12;
    assert_refused!(packed.bytes(), RecordingError::SampleType { number: 267, .. });
    let mut flat = valid();
    flat.signals[0].ranges[2] = 100.0;
    assert_refused!(flat.bytes(), RecordingError::Range { .. });
    let mut not_a_number = valid();
    not_a_number.signals[0].ranges[0] = f64::NAN;
    assert_refused!(not_a_number.bytes(), RecordingError::Range { .. });
    let mut zero_denominator = valid();
    zero_denominator.duration = (1, 0);
    assert_refused!(zero_denominator.bytes(), RecordingError::HeaderField { .. });
    let mut bytes = valid().bytes();
    bytes[252..254].copy_from_slice(&0_u16.to_le_bytes());
    assert_refused!(bytes.clone(), RecordingError::HeaderField { .. });
    bytes[252..254].copy_from_slice(&u16::MAX.to_le_bytes());
    assert_refused!(bytes, RecordingError::HeaderTruncated { .. });
    let mut short_header = valid().bytes();
    short_header[184] = 1;
    assert_refused!(short_header, RecordingError::HeaderField { .. });
    let mut unknown_version = valid().bytes();
    unknown_version[4] = b'9';
    assert_refused!(unknown_version, RecordingError::UnknownFormat { .. });
}

/// Reads the events, samples and warnings of a file.
fn read(bytes: Vec<u8>) -> (Vec<Event>, Vec<Vec<f64>>, Vec<Warning>) {
    let mut recording = open(bytes).expect("usable");
    let events = recording.events().expect("readable");
    let samples = read_all(&mut recording);
    (events, samples, recording.warnings().to_vec())
}

/// Builds a file of one float32 signal with `per_record` samples in each record of 1 s; its header
/// states -1 records.
fn unstated(per_record: u32, samples: &[f32], events: Vec<u8>) -> GdfFile {
    GdfFile { events, ..GdfFile::float32(-1, per_record, samples) }
}

#[test]
fn an_event_table_is_not_read_as_samples() {
    // The 80,000 samples of 4 bytes make the search read several blocks. The tables have 20, 32,
    // 20, 8, 26 and 20 bytes. The first four lengths are whole numbers of records of 4 bytes, so
    // the length alone does not distinguish a table from records.
    let samples: Vec<f32> = (0_u16..40_000).map(f32::from).collect();
    let samples = [&samples[..], &samples[..]].concat();
    let mut mode_3 = vec![3, 1, 0, 0];
    mode_3.extend(1.0_f32.to_le_bytes());
    mode_3.extend([5, 0, 0, 0, 0, 3, 0, 0, 2, 0, 0, 0]);
    for (per_record, events, labels) in [
        (1, event_table(1.0, &[(1, 768), (80_000, 0x8300)]), 2),
        (1, event_table(0.0, &[(1, 768), (2, 1), (3, 1), (4, 1)]), 4),
        (1, mode_3, 1),
        (1, event_table(1.0, &[]), 0),
        (2, event_table(2.0, &[(1, 1), (2, 2), (80_000, 3)]), 3),
        (40_000, event_table(40_000.0, &[(1, 1), (80_000, 2)]), 2),
    ] {
        let size = events.len();
        let file = unstated(per_record, &samples, events);
        let (found, read, warnings) = read(file.bytes());
        assert_eq!(found.len(), labels, "{per_record} per record, {size} bytes");
        let expected: Vec<f64> = samples.iter().copied().map(f64::from).collect();
        assert!(read[0] == expected, "{per_record} per record, {size} bytes");
        let derived = 80_000 / u64::from(per_record);
        assert_eq!(warnings, [Warning::RecordsUnknown { derived }]);
    }
}

#[test]
fn samples_that_look_like_a_table_stay_samples() {
    // Read as tables, the last bytes would mean: first, mode 1 with two rows at position 1,000,000
    // in a file of 8 s; second, mode 1 without rows at a rate of 3e-45 Hz. Neither is plausible.
    for words in [vec![9, 9, 9, 0x0201, 2, 1_000_000, 1_000_000, 7], vec![9, 9, 9, 9, 9, 9, 1, 2]] {
        let data = words.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        let file = GdfFile::version_2(-1, vec![GdfSignal::with_type(6, 1, data)]);
        let (events, samples, warnings) = read(file.bytes());
        assert_eq!(events, []);
        assert_eq!(samples[0].len(), words.len());
        assert_eq!(warnings, [Warning::RecordsUnknown { derived: 8 }]);
    }
}

#[test]
fn a_truncated_table_is_not_recognised() {
    let mut events = event_table(1.0, &[(1, 768), (2, 769)]);
    events.pop();
    let (events, samples, warnings) = read(unstated(8, &[0.5; 8], events).bytes());
    assert_eq!((events.len(), samples[0].len()), (0, 8));
    let truncated = Warning::Truncated { promised: 1, whole: 1, left_over: 19 };
    assert_eq!(warnings, [Warning::RecordsUnknown { derived: 1 }, truncated]);
}

#[test]
fn real_files_are_read_identically_without_their_number_of_records() {
    for file in [
        "gdf/alltypes.gdf",
        "gdf/Header3Tag1.gdf",
        "gdf/MI128.gdf",
        "gdf/mne_test_1ch.gdf",
        "derived/s001r04_61ch_512hz_i16.gdf",
    ] {
        let Some(path) = data(file) else {
            return;
        };
        let mut bytes = std::fs::read(path).expect("readable");
        let (events, samples, _) = read(bytes.clone());
        bytes[236..244].copy_from_slice(&(-1_i64).to_le_bytes());
        let (same_events, same_samples, warnings) = read(bytes);
        assert_eq!(same_events, events, "{file}");
        assert!(same_samples == samples, "{file}");
        let truncated = |warning: &Warning| matches!(warning, Warning::Truncated { .. });
        assert!(!warnings.iter().any(truncated), "{file}: {warnings:?}");
    }
}
