//! GDF files whose headers leave the number of records open (-1).

use recordings::{Event, EventLabel, Warning};

use crate::{
    gdf_writer::{GdfFile, GdfSignal},
    open, read_all,
    real_files::data,
    written_gdf::event_table,
};

/// What a file gives: its events, its samples and its warnings.
fn read(bytes: Vec<u8>) -> (Vec<Event>, Vec<Vec<f64>>, Vec<Warning>) {
    let mut recording = open(bytes).expect("usable");
    let events = recording.events().expect("readable");
    let samples = read_all(&mut recording);
    (events, samples, recording.warnings().to_vec())
}

/// A file of one float32 signal of `per_record` samples in 1 s, `-1` records in its header.
fn unstated(per_record: u32, samples: &[f32], events: Vec<u8>) -> GdfFile {
    let signal = GdfSignal::float32("Cz", per_record, samples);
    GdfFile {
        events,
        ..GdfFile::version_2(-1, vec![signal])
    }
}

#[test]
fn an_event_table_is_no_samples() {
    // 80,000 records of 4 bytes are read in several blocks; tables of 20 and 32 bytes are whole
    // records, one of 26 is not.
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
fn version_1_counts_its_rows_elsewhere() {
    let signal = GdfSignal::of_type(3, 1, vec![1, 0, 2, 0, 3, 0]);
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
    // As a table: mode 1, two rows, positions of 1,000,000 in a file of 8 s; and mode 1 without
    // a row, at a rate of 3e-45 Hz.
    for words in [
        vec![9, 9, 9, 0x0201, 2, 1_000_000, 1_000_000, 7],
        vec![9, 9, 9, 9, 9, 9, 1, 2],
    ] {
        let data = words
            .iter()
            .flat_map(|word: &u32| word.to_le_bytes())
            .collect();
        let file = GdfFile::version_2(-1, vec![GdfSignal::of_type(6, 1, data)]);
        let (events, samples, warnings) = read(file.bytes());
        assert_eq!(events, []);
        assert_eq!(samples[0].len(), words.len());
        assert_eq!(warnings, [Warning::RecordsUnknown { derived: 8 }]);
    }
}

#[test]
fn a_table_that_is_cut_off_closes_nowhere() {
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
fn real_files_are_read_alike_without_their_number_of_records() {
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
        assert!(
            !warnings
                .iter()
                .any(|warning| matches!(warning, Warning::Truncated { .. })),
            "{file}: {warnings:?}"
        );
    }
}
