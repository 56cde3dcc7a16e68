//! Tests that files of the EDF+, BDF+ and GDF writers read back with the same contents.
#![expect(
    clippy::cast_precision_loss,
    reason = "numbers of rows, times and words are small and exact"
)]

use std::io::Cursor;

use recordings::{
    EdfWriter, EventLabel, FileToWrite, Format, GdfWriter, Ratio, SignalToWrite, Warning,
};

use crate::{event, open, read_all};

fn file(rate_hz: u32, rows_per_record: u32) -> FileToWrite {
    let signal = |label: &str, is_integer: bool, range| SignalToWrite {
        label: label.to_owned(),
        is_microvolt: !is_integer,
        is_integer,
        range,
    };
    FileToWrite {
        signals: vec![
            signal("Cz", false, [-187_499.999_8, 187_499.999_8]),
            signal("word", true, [0.0, 65_535.0]),
        ],
        rate_hz,
        rows_per_record,
        start_ns: Some(1_700_000_000_123_456_789),
        description: "a device".to_owned(),
    }
}

fn value(row: u64) -> f32 {
    row as f32 * 123.4 - 20_000.0
}

fn word(row: u64) -> f32 {
    (row * 997 % 65_536) as f32
}

#[test]
fn values_rates_and_annotations_are_read_back() {
    let annotations = [
        (0..0, "on"),
        (31..31, "off"),
        (31..159, "on again@@Cz"),
        (32..32, "off"),
        (400..400, "late"),
    ];
    let annotations = annotations.map(|(rows, text)| (rows, text.to_owned()));
    let bytes = Cursor::new(Vec::new());
    let mut writer = EdfWriter::bdf(bytes, &file(512, 32), 160, annotations.to_vec()).unwrap();
    for record in 0..5 {
        let rows = (record * 32..(record + 1) * 32).flat_map(|row| [value(row), word(row)]);
        writer.write_record(&rows.collect::<Vec<f32>>()).unwrap();
    }
    let bytes = writer.finish().unwrap().into_inner();
    let start = jiff::Timestamp::from_second(1_700_000_000).unwrap();
    let start = jiff::tz::TimeZone::system().to_datetime(start);
    let start = start.strftime("%d.%m.%y%H.%M.%S").to_string();
    assert_eq!(&bytes[168..184], start.as_bytes());
    let mut recording = open(bytes).unwrap();
    assert_eq!(recording.format(), Format::BdfPlusContinuous);
    assert_eq!(recording.records(), 5);
    assert_eq!(recording.labels(), ["Cz", "word", "BDF Annotations"]);
    assert_eq!(recording.signals()[0].rate, Ratio::new(512, 1));
    let samples = read_all(&mut recording);
    assert_eq!((samples[0].len(), samples[2].len()), (160, 0));
    for row in 0..160 {
        // Values are rounded to steps of 375,000 uV / 2^24, so the error is at most half a step.
        let at = usize::try_from(row).unwrap();
        let error = samples[0][at] - f64::from(value(row));
        assert!(error.abs() <= 0.011_18, "{row}: {error}");
        assert_eq!(samples[1][at], f64::from(word(row)));
    }
    let events = recording.events().unwrap();
    assert_eq!(events.len(), annotations.len());
    for (event, (rows, text)) in events.iter().zip(&annotations) {
        assert!((event.onset_s - rows.start as f64 / 512.0).abs() < 1e-6);
        let duration_s = (!rows.is_empty()).then(|| (rows.end - rows.start) as f64 / 512.0);
        assert_eq!(event.duration_s, duration_s);
        assert_eq!(event.label, EventLabel::Text(text.clone()));
    }
    let others = recording.warnings().iter().map(ToString::to_string);
    let others: Vec<String> = others.filter(|warning| !warning.contains("word")).collect();
    assert_eq!(others, Vec::<String>::new());
}

#[test]
fn an_edf_file_holds_microvolts_in_tenths_and_its_annotations() {
    let file = FileToWrite::microvolts(["Cz"], [-3_276.8, 3_276.7], 128, 4);
    // The bytes 0x14 and 0 end parts of an annotation, and other programs skip texts with a line
    // feed, so all control characters become blanks.
    let annotations = vec![(5..5, "T1\r\n\x14\0\u{85}x".to_owned())];
    let mut writer = EdfWriter::edf(Cursor::new(Vec::new()), &file, 8, annotations).unwrap();
    writer.write_record(&[0.04, -0.06, 12.34, 4_000.0]).unwrap();
    let last = [-4_000.0, 3_276.7, -3_276.8, 1.0];
    writer.write_record(&last).unwrap();
    let mut recording = open(writer.finish().unwrap().into_inner()).unwrap();
    assert_eq!(recording.format(), Format::EdfPlusContinuous);
    let expected = [0.0, -0.1, 12.3, 3_276.7, -3_276.8, 3_276.7, -3_276.8, 1.0];
    for (value, expected) in read_all(&mut recording)[0].iter().zip(expected) {
        assert!((value - expected).abs() < 1e-9, "{value} {expected}");
    }
    let events = recording.events().unwrap();
    assert_eq!(events[0].label, EventLabel::Text("T1     x".to_owned()));
    assert!((events[0].onset_s - 5.0 / 128.0).abs() < 1e-6);
    assert_eq!(recording.warnings(), []);
}

#[test]
fn integers_beyond_16_bits_do_not_fit_an_edf_file() {
    let error = EdfWriter::edf(Cursor::new(Vec::new()), &file(128, 4), 4, Vec::new()).unwrap_err();
    assert!(error.to_string().contains("choose BDF"), "{error}");
}

#[test]
fn what_does_not_fit_the_format_is_an_error() {
    for (rate_hz, rows) in [(0, 1), (512, 0), (240, 5)] {
        let file = file(rate_hz, rows);
        assert!(EdfWriter::bdf(Cursor::new(Vec::new()), &file, 1, Vec::new()).is_err());
    }
    for signals in [0, 65_535] {
        assert!(GdfWriter::new(Cursor::new(Vec::new()), &gdf_file(signals)).is_err());
    }
    let mut writer = GdfWriter::new(Cursor::new(Vec::new()), &gdf_file(2)).unwrap();
    assert!(writer.write_record(&[0.0; 63]).is_err());
    assert!(writer.finish(&[(u64::from(u32::MAX), 1)]).is_err());
}

fn gdf_file(signals: usize) -> FileToWrite {
    let signal = |index: usize| SignalToWrite {
        label: format!("signal {index} with a long label"),
        is_microvolt: index.is_multiple_of(2),
        is_integer: false,
        range: [-187_500.0, 187_500.0],
    };
    FileToWrite { signals: (0..signals).map(signal).collect(), ..file(512, 32) }
}

#[test]
fn values_rates_labels_and_events_are_read_back_unchanged() {
    let mut writer = GdfWriter::new(Cursor::new(Vec::new()), &gdf_file(3)).unwrap();
    let value = |row: usize, signal: usize| row as f32 * 0.1 - 7.3 * signal as f32;
    for record in 0..5 {
        let rows = (record * 32..(record + 1) * 32)
            .flat_map(|row| (0..3).map(move |signal| value(row, signal)));
        writer.write_record(&rows.collect::<Vec<f32>>()).unwrap();
    }
    let events = [(0_u32, 1), (1, 0x8001), (159, 768)];
    let bytes = writer.finish(&events.map(|(row, kind)| (row.into(), kind))).unwrap().into_inner();
    let mut recording = open(bytes).unwrap();
    assert_eq!(recording.format(), Format::Gdf2(2.2));
    // Only the signals without a unit cause a warning.
    assert!(matches!(recording.warnings(), [Warning::UnitUnknown { .. }]));
    assert_eq!(recording.records(), 5);
    assert_eq!(recording.labels()[1], "signal 1 with a");
    assert_eq!(recording.signals()[0].rate, Ratio::new(512, 1));
    assert_eq!(recording.signals()[0].unit.microvolts(), Some(1.0));
    assert_eq!(recording.signals()[1].unit.microvolts(), None);
    for (signal, samples) in read_all(&mut recording).iter().enumerate() {
        let expected: Vec<f64> = (0..160).map(|row| value(row, signal).into()).collect();
        assert_eq!(*samples, expected);
    }
    let expected =
        events.map(|(row, kind)| event(f64::from(row) / 512.0, None, EventLabel::Type(kind)));
    assert_eq!(recording.events().unwrap(), expected);
}

#[test]
fn a_file_that_was_not_finished_is_read_as_far_as_it_goes() {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = GdfWriter::new(&mut bytes, &gdf_file(2)).unwrap();
    writer.write_record(&[1.5; 64]).unwrap();
    drop(writer);
    let mut recording = open(bytes.into_inner()).unwrap();
    assert_eq!(recording.records(), 1);
    assert_eq!(read_all(&mut recording)[1], [1.5; 32]);
}

#[test]
fn values_beyond_the_range_are_clamped() {
    let mut writer = EdfWriter::bdf(Cursor::new(Vec::new()), &file(2, 1), 2, Vec::new()).unwrap();
    writer.write_record(&[1e9, -5.0]).unwrap();
    writer.write_record(&[-1e9, 1e6]).unwrap();
    let mut recording = open(writer.finish().unwrap().into_inner()).unwrap();
    let samples = read_all(&mut recording);
    assert_eq!(samples[0], [187_500.0, -187_500.0]);
    assert_eq!(samples[1], [0.0, 65_535.0]);
}
