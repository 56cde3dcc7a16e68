//! Tests samples, events, warnings and errors of synthetic EDF, EDF+ and BDF files.

use recordings::{Format, Ratio, RecordingError, Warning};

use crate::{
    files::{EdfFile, EdfSignal},
    open, read_all,
};

#[test]
fn signals_with_different_rates_keep_their_samples_and_units() {
    let slow = EdfSignal {
        unit: "mV",
        ranges: ["-1", "1", "-100", "100"].map(str::to_owned),
        ..EdfSignal::int16("EEG Cz", 2, &[-100, 0, 50, 100])
    };
    let fast = EdfSignal::int16("EOG", 4, &[1, 2, 3, 4, 5, 6, 7, 8]);
    let file = EdfFile { duration: "0.5", ..EdfFile::edf("2", vec![slow, fast]) };
    let mut recording = open(file.bytes()).expect("a valid file");
    assert_eq!(recording.format(), Format::Edf);
    assert_eq!(recording.warnings(), []);
    assert_eq!(recording.duration_s(), 1.0);
    let rates = recording.signals().iter().map(|signal| signal.rate.map(Ratio::value));
    assert_eq!(rates.collect::<Vec<_>>(), [Some(4.0), Some(8.0)]);
    assert_eq!(recording.signals()[0].unit.microvolts(), Some(1000.0));
    let samples = read_all(&mut recording);
    assert_eq!(samples[0], [-1.0, 0.0, 0.5, 1.0]);
    assert_eq!(samples[1], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    recording.rewind();
    assert_eq!(read_all(&mut recording), samples, "a second pass");
}

#[test]
fn bdf_samples_have_24_bits() {
    let data = vec![0, 0, 0x80, 0xff, 0xff, 0x7f, 0xfe, 0xff, 0xff, 1, 2, 0];
    let mut file = EdfFile::bdf("1", 4, data);
    file.signals[0].label = "Status";
    let mut recording = open(file.bytes()).expect("a valid file");
    assert_eq!(recording.format(), Format::Bdf);
    let expected = [-8_388_608.0, 8_388_607.0, -2.0, 513.0];
    assert_eq!(read_all(&mut recording)[0], expected);
    let label = "Status".to_owned();
    assert_eq!(recording.warnings(), [Warning::Triggers { label }]);
}

#[test]
fn unknown_and_wrong_numbers_of_records_cause_a_warning() {
    let signal = || vec![EdfSignal::int16("Cz", 2, &[1, 2, 3, 4, 5, 6])];
    for unknown in ["-1", "0"] {
        let derived = open(EdfFile::edf(unknown, signal()).bytes()).expect("usable");
        assert_eq!(derived.warnings(), [Warning::RecordsUnknown { derived: 3 }]);
        assert_eq!(derived.records(), 3);
    }

    let mut bytes = EdfFile::edf("5", signal()).bytes();
    bytes.extend([9, 9, 9]);
    let mut truncated = open(bytes).expect("usable");
    let warning = Warning::Truncated { promised: 5, whole: 3, left_over: 3 };
    assert_eq!(truncated.warnings(), [warning]);
    assert_eq!(read_all(&mut truncated)[0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);

    let mut bytes = EdfFile::edf("1", signal()).bytes();
    bytes.push(0);
    let mut longer = open(bytes).expect("usable");
    let warning = longer.warnings()[0].to_string();
    assert!(warning.contains("2 records (2.000 s) and 1 bytes"), "{warning}");
    assert!(warning.contains("write -1") && warning.contains("byte 236"), "{warning}");
    assert_eq!(read_all(&mut longer)[0].len(), 2);
}

#[test]
fn unusable_headers_are_refused_with_the_name_of_the_field() {
    let valid = || EdfFile::edf("1", vec![EdfSignal::int16("Cz", 2, &[1, 2])]);
    let with_range = |range: usize, value: &str| {
        let mut file = valid();
        file.signals[0].ranges[range] = value.to_owned();
        file
    };
    let with_duration = |duration| EdfFile { duration, ..valid() };
    let records = "-7";
    for (file, expected) in [
        (with_range(3, "-32768"), "signal Cz cannot be scaled: digital -32768..-32768"),
        (with_range(1, "inf"), "cannot be scaled"),
        (with_duration("0"), "duration of a record"),
        (with_duration("1 s"), "holds \"1 s\", which is not usable: a plain number"),
        (EdfFile { records, ..valid() }, "number of records"),
        (EdfFile::edf("0", Vec::new()), "number of signals"),
    ] {
        let message = open(file.bytes()).err().expect("refused").to_string();
        assert!(message.contains(expected), "{message}");
    }

    let bytes = valid().bytes();
    assert_refused!(
        bytes[..300].to_vec(),
        RecordingError::HeaderTruncated { needed: 512, found: 300 }
    );
    assert_refused!(
        bytes[..512].to_vec(),
        RecordingError::NoData { record_bytes: 4, data_bytes: 0 }
    );
    assert_refused!(Vec::new(), RecordingError::Empty);
    for other in [&b"GDF"[..], b"%PDF-1.7 something else"] {
        assert_refused!(other.to_vec(), RecordingError::UnknownFormat { .. });
    }
}
