//! Files of the GDF writer, read by the GDF reader.
#![expect(
    clippy::cast_precision_loss,
    reason = "numbers of rows, times and words are small and exact"
)]

use std::io::Cursor;

use recordings::{
    Event, EventLabel, FileToWrite, Format, GdfWriter, Ratio, SignalToWrite, Warning,
};

use crate::{open, read_all};

fn file(signals: usize) -> FileToWrite {
    let signal = |index: usize| SignalToWrite {
        label: format!("signal {index} with a long label"),
        is_microvolt: index.is_multiple_of(2),
        is_integer: false,
        range: [-187_500.0, 187_500.0],
    };
    FileToWrite {
        signals: (0..signals).map(signal).collect(),
        rate_hz: 512,
        rows_per_record: 32,
        start_ns: 1_700_000_000_123_456_789,
        description: "a device".to_owned(),
    }
}

#[test]
fn values_rates_labels_and_events_are_read_back_unchanged() {
    let mut writer = GdfWriter::new(Cursor::new(Vec::new()), &file(3)).unwrap();
    let value = |row: usize, signal: usize| row as f32 * 0.1 - 7.3 * signal as f32;
    for record in 0..5 {
        let rows = (record * 32..(record + 1) * 32)
            .flat_map(|row| (0..3).map(move |signal| value(row, signal)));
        writer.write_record(&rows.collect::<Vec<f32>>()).unwrap();
    }
    let events = [(0_u32, 1), (1, 0x8001), (159, 768)];
    let bytes = writer
        .finish(&events.map(|(row, kind)| (row.into(), kind)))
        .unwrap()
        .into_inner();
    let mut recording = open(bytes).unwrap();
    assert_eq!(recording.format(), Format::Gdf2(2.2));
    // Of the signals only those in microvolts can be played.
    assert!(matches!(
        recording.warnings(),
        [Warning::UnitUnknown { .. }]
    ));
    assert_eq!(recording.records(), 5);
    assert_eq!(recording.labels()[1], "signal 1 with a");
    assert_eq!(recording.signals()[0].rate, Ratio::new(512, 1));
    assert_eq!(recording.signals()[0].unit.microvolts(), Some(1.0));
    assert_eq!(recording.signals()[1].unit.microvolts(), None);
    for (signal, samples) in read_all(&mut recording).iter().enumerate() {
        let expected: Vec<f64> = (0..160).map(|row| value(row, signal).into()).collect();
        assert_eq!(*samples, expected);
    }
    let expected = events.map(|(row, kind)| Event {
        onset_s: f64::from(row) / 512.0,
        duration_s: None,
        signal: None,
        label: EventLabel::Type(kind),
    });
    assert_eq!(recording.events().unwrap(), expected);
}

#[test]
fn a_file_that_was_not_finished_is_read_as_far_as_it_goes() {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = GdfWriter::new(&mut bytes, &file(2)).unwrap();
    writer.write_record(&[1.5; 64]).unwrap();
    drop(writer);
    let mut recording = open(bytes.into_inner()).unwrap();
    assert_eq!(recording.records(), 1);
    assert_eq!(read_all(&mut recording)[1], [1.5; 32]);
}

#[test]
fn what_does_not_fit_the_format_is_an_error() {
    for signals in [0, 65_535] {
        assert!(GdfWriter::new(Cursor::new(Vec::new()), &file(signals)).is_err());
    }
    let mut writer = GdfWriter::new(Cursor::new(Vec::new()), &file(2)).unwrap();
    assert!(writer.write_record(&[0.0; 63]).is_err());
    assert!(writer.finish(&[(u64::from(u32::MAX), 1)]).is_err());
}
