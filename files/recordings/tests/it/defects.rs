//! Tests that a defect of a file is reported and costs no more data than necessary.

use recordings::{
    AdcSpec, Event, EventLabel, Format, Missing, MontageMap, RecordingError, VirtualAdc,
};

use crate::{
    event,
    files::{EdfFile, EdfSignal, GdfFile, event_table},
    open, read_all,
};

/// Returns a file of one record with the signal `Cz`, which has the samples 1 and 2.
fn edf() -> EdfFile {
    EdfFile::edf("1", vec![EdfSignal::int16("Cz", 2, &[1, 2])])
}

#[test]
fn a_defect_that_does_not_prevent_reading_is_a_warning_and_the_samples_are_read() {
    let mut file = edf();
    file.signals.push(EdfSignal::int16("temp", 1, &[7]));
    // Offset of the physical minimum of each signal. The physical maximum, the digital minimum and
    // the digital maximum follow 16, 32 and 48 bytes later.
    let [cz, temp] = [464, 472];
    let (version, duration) = (0, 244);
    for (at, fields, said) in [
        (temp, "0/0/0/0", "temp (digital 0..0, physical 0..0)"),
        (temp, "//0/1", "temp (digital 0..1, physical ..)"),
        (temp, "low/high/0/1", "physical low..high"),
        (temp, "0/1/nan/inf", "digital nan..inf"),
        (temp, "0/1/-32,768/32,767", "digital -32,768..32,767"),
        (temp, "0,5/45,5/0/100", "2 header fields, such as \"0,5\""),
        (cz, "-3276,8/3276,7", "such as \"-3276,8\" (physical limit of signal 1 (Cz))"),
        (cz, "-10/10/-100,0/100,0", "2 header fields, such as \"-100,0\""),
        (duration, "1,0", "such as \"1,0\" (duration of a record of the file)"),
        (version, "20160817", "the version in the header is '20160817'"),
        (version, "0.1", "the version in the header is '0.1'"),
    ] {
        let mut bytes = file.bytes();
        for (field, text) in fields.split('/').enumerate() {
            bytes[at + 16 * field..][..8].copy_from_slice(format!("{text:8}").as_bytes());
        }
        let mut recording = open(bytes).expect("usable");
        let warnings: Vec<String> = recording.warnings().iter().map(ToString::to_string).collect();
        assert_eq!(warnings.len(), 1, "{said}: {warnings:?}");
        assert!(warnings[0].contains(said), "{said}: {}", warnings[0]);
        assert_eq!(recording.format(), Format::Edf);
        let signal = &recording.signals()[0];
        let gain = signal.calibration.as_ref().expect("a range").gain();
        let samples = &read_all(&mut recording)[0];
        let mut pairs = samples.iter().zip([gain, 2.0 * gain]);
        // The physical limits are decimals of at most 3276.8, whose rounding errors pass on to the
        // samples.
        assert!(pairs.all(|(found, value)| (found - value).abs() < 1e-11), "{samples:?}");
        assert_eq!(recording.duration_s(), 1.0);
    }
}

#[test]
fn a_signal_that_cannot_be_scaled_is_refused_where_it_is_used() {
    let mut file = edf();
    file.signals.push(EdfSignal {
        ranges: ["0", "0", "0", "0"].map(str::to_owned),
        ..EdfSignal::int16("Pz", 2, &[1, 2])
    });
    let play = |missing, electrode| {
        let recording = open(file.bytes()).expect("usable");
        let map = MontageMap::new(&recording.labels(), &["Cz", electrode], missing).expect("a map");
        VirtualAdc::new(recording, &map, AdcSpec::ads1299(512)).err()
    };
    assert!(play(Missing::Zero, "Oz").is_none());
    for (missing, electrode) in [(Missing::Zero, "Pz"), (Missing::Interpolate, "Oz")] {
        let error = play(missing, electrode).expect("refused");
        assert!(matches!(&error, RecordingError::Range { label, .. } if label == "Pz"), "{error}");
        assert!(error.to_string().contains("give it another label"), "{error}");
    }
}

#[test]
fn a_file_that_is_no_edf_file_is_not_read_as_one() {
    let bytes = EdfFile { magic: *b"20160817", ..edf() }.bytes();
    // Each of these files has a different defect: a wrong header length, a wrong number of signals,
    // a binary version, a missing end.
    let damage = |at: usize, byte: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = byte;
        bytes
    };
    for bytes in [damage(184, b'9'), damage(252, b'2'), damage(3, 7), bytes[..200].to_vec()] {
        assert_refused!(bytes, RecordingError::UnknownFormat { .. });
    }
}

#[test]
fn events_are_played_at_their_sample_although_times_of_records_are_odd() {
    // Each text holds three records, separated by blanks, in which `|` stands for byte 0x14, `^`
    // for 0x15 and `;` for 0. The events are 0.25 s after the start of each record.
    for (reserved, lists, warning) in [
        // The file starts 0.640625 s after the time in the header.
        (
            "EDF+C",
            "+0.640625||;+.890625|a|; +1.640625||;+1.890625|b|; +2.640625||;+2.890625|c|;",
            "",
        ),
        // In EDF+C, only the first record's time counts.
        ("EDF+C", "+0||;+0.25|a|; +0||;+1.25|b|; +0||;+2.25|c|;", ""),
        ("EDF+C", "+5||;+5.25|a|; ; +6.25|b|;+7.25|c|;", ""),
        // Records without a usable time start at the end of the previous record.
        ("EDF+D", "+5||;+5.25|a|; +6.25|b|; +1||;+7.25|c|;", "2 records have no time"),
        (
            "EDF+D",
            "+5||;+5.25|a|; +60||;+60.25|b|; +99.5||;+99.75|c|;",
            "2 gaps between records, 92.5 s",
        ),
        // Only the invalid lists are lost.
        (
            "EDF+C",
            "+0||;+0.1^|x|;+0.25|a|; rubbish;+1.25|b|; +2||;+2.25|c|;",
            "2 annotation lists cannot be read and are left out, the first is \"+0.1\\x15\\x14x\\x14\"",
        ),
    ] {
        let bytes = lists.replace('|', "\x14").replace('^', "\x15").replace(';', "\0");
        let records: Vec<&[u8]> = bytes.split(' ').map(str::as_bytes).collect();
        let file = EdfFile::edf_plus(reserved, "3", (4, &[0; 12]), &records);
        let mut recording = open(file.bytes()).expect("usable");
        for _ in 0..2 {
            let onsets = recording.onsets().expect("readable");
            let labels = ["a", "b", "c"].map(|text| EventLabel::Text(text.to_owned()));
            assert_eq!(
                (&onsets.seconds[..], &onsets.labels[..]),
                (&[0.25, 1.25, 2.25][..], &labels[..]),
                "{lists}"
            );
        }
        let warnings: Vec<String> = recording.warnings().iter().map(ToString::to_string).collect();
        assert_eq!(warnings.len(), usize::from(!warning.is_empty()), "{warnings:?}");
        assert!(warnings.iter().all(|said| said.contains(warning)), "{warnings:?}");
    }
}

/// Encodes an event table whose positions count samples at 4 Hz, in any mode, from `rows`:
/// (position, type, channel, duration).
fn table(mode: u8, rows: &[(u32, u16, u16, u32)]) -> Vec<u8> {
    let pairs: Vec<(u32, u16)> = rows.iter().map(|row| (row.0, row.1)).collect();
    let mut table = event_table(4.0, &pairs);
    table[0] = mode;
    if mode & 2 != 0 {
        table.extend(rows.iter().flat_map(|row| row.2.to_le_bytes()));
        table.extend(rows.iter().flat_map(|row| row.3.to_le_bytes()));
    }
    if mode & 4 != 0 {
        // A time stamp for each row.
        table.extend([1; 8].repeat(rows.len()));
    }
    table
}

#[test]
fn event_tables_of_all_modes_and_types_from_0x8000_are_played() {
    let rows = [(1, 0x8205, 0, 4), (3, 0x0301, 5, 0), (5, 0x8301, 5, 0), (6, 0x8301, 0, 0)];
    for (mode, records) in [1, 3, 5, 7].into_iter().flat_map(|mode| [2, -1, 0].map(|n| (mode, n))) {
        let mut file = GdfFile::float32(records, 4, &[1.5; 8]);
        file.version = "2.51";
        file.events = table(mode, &rows);
        let mut recording = open(file.bytes()).expect("usable");
        let has_durations = mode & 2 != 0;
        let first = event(0.0, has_durations.then_some(1.0), EventLabel::Type(0x8205));
        let found = recording.events().expect("readable");
        assert_eq!((found.len(), &found[0]), (4, &first), "mode {mode}");
        assert_eq!(found[1].signal, has_durations.then_some(4));
        assert_eq!(recording.onsets().expect("readable").seconds, [0.0, 0.5, 1.25]);
        assert_eq!(read_all(&mut recording)[0].len(), 8, "mode {mode}");
    }
    for mode in [0, 2, 4, 9] {
        let mut file = GdfFile::float32(2, 4, &[1.5; 8]);
        file.events = table(mode, &rows);
        let mut recording = open(file.bytes()).expect("usable");
        assert_eq!(recording.events().expect("readable"), []);
        let warning = recording.warnings()[0].to_string();
        assert!(warning.contains("announces 4 events"), "{warning}");
    }
}

#[test]
fn a_sparse_sample_has_a_value_instead_of_a_duration_and_is_counted() {
    let rows = [(1, 0x7fff, 2, 0xffff_fff6), (2, 0x7fff, 2, 7), (3, 0x0301, 0, 4)];
    for mode in [1, 3] {
        let mut file = GdfFile::float32(2, 4, &[1.5; 8]);
        file.events = table(mode, &rows);
        let mut recording = open(file.bytes()).expect("usable");
        assert_eq!(recording.onsets().expect("readable").seconds, [0.5]);
        let warning = recording.warnings()[0].to_string();
        assert!(warning.contains("2 sparse samples"), "{warning}");
        // Mode 1 has no duration column, so the type is an ordinary event type.
        let (label, signal) = match mode {
            1 => (EventLabel::Type(0x7fff), None),
            _ => (EventLabel::SparseSample(0xffff_fff6), Some(1)),
        };
        let expected = Event { signal, ..event(0.0, None, label) };
        assert_eq!(recording.events().expect("readable")[0], expected);
    }
}

#[test]
fn impossible_sizes_are_refused_without_an_allocation() {
    // The header announces 99,999,999 samples in a record, but the file has a few hundred bytes.
    let file = EdfFile::edf("99999999", vec![EdfSignal::int16("Cz", 99_999_999, &[])]);
    let mut bytes = file.bytes();
    bytes.extend([0; 100]);
    let error = open(bytes).err().expect("refused").to_string();
    assert!(error.contains("a record takes 199999998 bytes and the file holds 100"), "{error}");

    let mut file = GdfFile::float32(i64::MAX, u32::MAX, &[]);
    file.signals[0].type_number = 17;
    let error = open(file.bytes()).err().expect("refused").to_string();
    assert!(error.contains("a record takes 34359738360 bytes"), "{error}");
}
