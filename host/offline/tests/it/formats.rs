//! Each file format stores the values that the model's decoder computes, in microvolts, and the
//! events of the recording.

use std::fs;

use artifact::reconstruction::{WindowDecoder, dequantise};
use link::Flags;
use offline::{Model, Progress, SignalFormat};
use pipeline::{Mains, Pipeline};
use recordings::{EdfWriter, EventLabel, Recording};

use crate::recording::{ENCODING, EVENTS, Fixture, decoding, file_to_write, labels, values};

/// Largest rounding error of a 16-bit file, of a 24-bit file and of float32, uV.
const ROUNDING_UV: [(SignalFormat, f64); 3] =
    [(SignalFormat::Edf, 0.050_01), (SignalFormat::Bdf, 0.011_2), (SignalFormat::Gdf, 0.0)];

#[test]
fn rows_are_the_means_of_all_windows_that_contain_them() {
    let fixture = Fixture::new();
    let encoded = fixture.encode();
    let expected = expected(&fixture);
    let rows = expected.len();
    assert_eq!(
        rows,
        (usize::try_from(encoded.stats.codes_made).expect("few") - 1) * model::HOP + model::STEPS
    );
    for (format, tolerance) in ROUNDING_UV {
        let name = format!("decoded.{}", format.extension());
        let decoded = fixture.decode(&fixture.codes(), &name, format, true);
        let decoded = decoded.expect("decoded");
        assert_eq!(decoded.rows, rows as u64);
        assert_eq!((decoded.missing, decoded.damaged, decoded.limited), (0, 0, 0));
        let written = values(&fixture.path(&name));
        for (electrode, written) in written.iter().enumerate() {
            assert_eq!(written.len(), rows, "{format:?}");
            for (row, value) in written.iter().enumerate() {
                let difference = (value - f64::from(expected[row][electrode])).abs();
                assert!(difference <= tolerance, "{format:?}, row {row}: {difference}");
            }
        }
        let recording = Recording::open(fixture.path(&name)).expect("a recording");
        assert_eq!(recording.labels()[..labels().len()], labels());
        assert!(recording.warnings().is_empty(), "{format:?}");
    }
}

#[test]
fn events_stand_at_the_rows_that_show_them() {
    let fixture = Fixture::new();
    fixture.encode();
    for format in [SignalFormat::Edf, SignalFormat::Bdf, SignalFormat::Gdf] {
        let name = format!("decoded.{}", format.extension());
        let decoded = fixture.decode(&fixture.codes(), &name, format, true);
        decoded.expect("decoded");
        let mut recording = Recording::open(fixture.path(&name)).expect("a recording");
        let events = recording.events().expect("events");
        assert_eq!(events.len(), EVENTS.len(), "{format:?}");
        for (event, (row, kind)) in events.iter().zip(EVENTS) {
            let delay_s = f64::from(Mains::Hz50.filter().group_delay_us) / 1e6;
            #[expect(clippy::cast_precision_loss, reason = "small whole numbers")]
            let expected_s = row as f64 / f64::from(model::ADC_RATE_HZ) + delay_s;
            let difference = (event.onset_s - expected_s).abs();
            assert!(difference <= 0.5 / 128.0 + 1e-6, "{format:?}: {difference} s");
            let label = match format {
                SignalFormat::Gdf => EventLabel::Type(kind),
                _ => EventLabel::Text(format!("{kind:#06x}")),
            };
            assert_eq!(event.label, label);
        }
    }
}

#[test]
fn texts_of_events_get_types_in_a_gdf_file() {
    let fixture = Fixture::new();
    fixture.encode();
    let texts = fixture.decode(&fixture.codes(), "texts.edf", SignalFormat::Edf, true);
    texts.expect("decoded");
    let (texts, codes) = (fixture.path("texts.edf"), fixture.path("texts.codes"));
    ENCODING.encode(&texts, &codes, &Progress::default()).expect("encoded");
    let model = Model::embedded().expect("a model");
    let output = fixture.path("types.gdf");
    let decoding = decoding(&model, SignalFormat::Gdf);
    let decoded = decoding.decode(&codes, &output, Some(&texts), &Progress::default());
    let types = decoded.expect("decoded").event_types;
    assert_eq!(types, [("0x0301".to_owned(), 1), ("0x0302".to_owned(), 2)]);
    let mut recording = Recording::open(output).expect("a recording");
    let labels = recording.events().expect("events").into_iter().map(|event| event.label);
    let labels: Vec<EventLabel> = labels.collect();
    assert_eq!(labels, [1, 2, 1].map(EventLabel::Type));
}

#[test]
fn every_text_is_kept_but_a_gdf_file_has_types_for_254_of_them() {
    let fixture = Fixture::new();
    fixture.encode();
    let texts: Vec<_> = (0..300)
        .map(|number| (500 + 8 * number, format!("trial {number}")))
        .map(|(row, text)| (row..row, text))
        .collect();
    let original = fixture.path("texts.edf");
    let file = fs::File::create(&original).expect("a file");
    let description = file_to_write();
    let rows = 7 * u64::from(description.rate_hz);
    let mut writer = EdfWriter::edf(file, &description, rows, texts).expect("a header");
    let record = vec![0.0; labels().len() * description.rows_per_record as usize];
    for _ in 0..rows / u64::from(description.rows_per_record) {
        writer.write_record(&record).expect("a record");
    }
    writer.finish().expect("a file");
    let model = Model::embedded().expect("a model");
    for (format, kept) in [
        (SignalFormat::Edf, 300),
        (SignalFormat::Bdf, 300),
        (SignalFormat::Csv, 300),
        (SignalFormat::Npz, 300),
        (SignalFormat::Gdf, 254),
    ] {
        let output = fixture.path(&format!("events.{}", format.extension()));
        let decoding = decoding(&model, format);
        let codes = fixture.codes();
        let decoded = decoding.decode(&codes, &output, Some(&original), &Progress::default());
        let warnings = decoded.expect("decoded").warnings.join("\n");
        let bytes = fs::read(&output).expect("a file");
        let held = match format {
            SignalFormat::Csv => String::from_utf8_lossy(&bytes).matches("trial ").count(),
            // numpy's texts are UTF-32.
            SignalFormat::Npz => bytes.windows(8).filter(|text| *text == b"t\0\0\0r\0\0\0").count(),
            _ => Recording::open(output).expect("a file").events().expect("events").len(),
        };
        assert_eq!(held, kept, "{format:?}: {warnings}");
        assert_eq!(warnings.contains("46 events are left out: a GDF file"), kept < 300);
    }
}

#[test]
fn a_line_of_csv_has_row_time_flags_events_and_microvolts() {
    let fixture = Fixture::new();
    fixture.encode();
    let decoded = fixture.decode(&fixture.codes(), "decoded.csv", SignalFormat::Csv, true);
    decoded.expect("decoded");
    let text = fs::read_to_string(fixture.path("decoded.csv")).expect("text");
    let mut lines = text.lines();
    let header = format!("row,time_s,flags,events,{}", labels().join(","));
    assert_eq!(lines.next(), Some(&*header));
    let expected = expected(&fixture);
    let mut events = Vec::new();
    for (row, line) in lines.enumerate() {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields[0], row.to_string());
        events.extend(fields[3].split('|').filter(|event| !event.is_empty()));
        let written: Vec<f32> = fields[4..].iter().map(|x| x.parse().expect("a number")).collect();
        assert_eq!(written, expected[row]);
        let is_settling = row < model::HOP;
        // In the first hop, the filters settle, and only one window contains each row.
        let settling = (Flags::SETTLING | Flags::HEALING).bits().to_string();
        assert!(!is_settling || fields[2] == settling, "row {row}: {}", fields[2]);
    }
    assert_eq!(events, ["0x0301", "0x0302", "0x0301"]);
    let delay_s = f64::from(Mains::Hz50.filter().group_delay_us) / 1e6;
    let second = text.lines().nth(129).expect("row 128");
    assert!(second.starts_with(&format!("128,{:.6},", 1.0 - delay_s)), "{second}");
}

/// Returns the values of all electrodes in each row, uV. Each value is the mean over all windows
/// that contain the row.
fn expected(fixture: &Fixture) -> Vec<Vec<f32>> {
    let mut pipeline = Pipeline::new(Mains::Hz50);
    let folder =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../signal/model/artifact");
    let artifact = artifact::Artifact::read(&folder).expect("the checked-in model");
    let decoder = WindowDecoder::new(&artifact).expect("a decoder");
    let electrodes = labels().len();
    let mut rows: Vec<Vec<Vec<f32>>> = Vec::new();
    for sample in fixture.samples() {
        let Some(code) = pipeline.encode_sample(&sample) else {
            continue;
        };
        let levels = code.values.levels().into_iter();
        let numbers = model::CODE_SCALE.iter().zip(&model::CODE_ZERO_POINT);
        let z = levels.zip(numbers).map(|(level, (scale, zero))| dequantise(level, *scale, *zero));
        let window = decoder.decode(&z.collect::<Vec<f32>>());
        let first = usize::try_from(code.window).expect("few windows") * model::HOP;
        for (step, values) in window.chunks_exact(electrodes).enumerate() {
            rows.resize_with(rows.len().max(first + step + 1), Vec::new);
            rows[first + step].push(values.to_vec());
        }
    }
    let mean = |windows: Vec<Vec<f32>>| -> Vec<f32> {
        #[expect(clippy::cast_precision_loss, reason = "a few windows")]
        let share = 1.0 / windows.len() as f32;
        let sum = |electrode: usize| windows.iter().map(|window| window[electrode]).sum::<f32>();
        (0..electrodes).map(|electrode| sum(electrode) * share).collect()
    };
    rows.into_iter().map(mean).collect()
}
