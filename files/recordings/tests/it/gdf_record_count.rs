//! Number of records found in GDF files whose header states -1 records.

use recordings::{Event, EventLabel, Warning};

use crate::{
    files::{GdfFile, GdfSignal, event_table},
    open, read_all,
    real_files::data,
};

/// Reads the events, samples and warnings of a file.
fn read(bytes: Vec<u8>) -> (Vec<Event>, Vec<Vec<f64>>, Vec<Warning>) {
    let mut recording = open(bytes).expect("usable");
    let events = recording.events().expect("readable");
    let samples = read_all(&mut recording);
    (events, samples, recording.warnings().to_vec())
}

/// Builds a file with one float32 signal, `per_record` samples per record of 1 s, and -1 records in
/// its header.
fn unstated(per_record: u32, samples: &[f32], events: Vec<u8>) -> GdfFile {
    GdfFile {
        events,
        ..GdfFile::float32(-1, per_record, samples)
    }
}

#[test]
fn an_event_table_is_not_read_as_samples() {
    // The 80,000 samples of 4 bytes are searched in several blocks. The tables have 20, 32, 20, 8,
    // 26 and 20 bytes. With records of 4 bytes, the first four tables are as long as whole records;
    // the other two are not.
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
fn the_event_table_of_version_1_is_found() {
    let signal = GdfSignal::with_type(3, 1, vec![1, 0, 2, 0, 3, 0]);
    let mut file = GdfFile::version_2(-1, vec![signal]);
    file.version_1 = true;
    file.events = vec![1, 1, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, 5, 3];
    let (events, samples, warnings) = read(file.bytes());
    assert_eq!(events.len(), 1);
    assert_eq!(events[0].label, EventLabel::Type(0x0305));
    assert_eq!(samples[0].len(), 3);
    assert_eq!(warnings, [Warning::RecordsUnknown { derived: 3 }]);
}

#[test]
fn samples_that_look_like_a_table_stay_samples() {
    // Read as event tables, the last bytes are: first, mode 1 with two rows at position 1,000,000,
    // in a file of 8 s; second, mode 1 without rows at a rate of 3e-45 Hz. Neither is plausible.
    for words in [
        vec![9, 9, 9, 0x0201, 2, 1_000_000, 1_000_000, 7],
        vec![9, 9, 9, 9, 9, 9, 1, 2],
    ] {
        let data = words
            .iter()
            .flat_map(|word: &u32| word.to_le_bytes())
            .collect();
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
    let truncated = Warning::Truncated {
        promised: 1,
        whole: 1,
        left_over: 19,
    };
    assert_eq!(
        warnings,
        [Warning::RecordsUnknown { derived: 1 }, truncated]
    );
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
