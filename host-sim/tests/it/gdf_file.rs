//! Writes GDF files with the electrodes of the model.

use std::io::Write as _;

use recordings::{FileToWrite, GdfWriter, SignalToWrite};
use tempfile::NamedTempFile;

/// Writes a file of `rows` rows, whose microvolts `row` returns, with events at rows.
pub(crate) fn gdf_file(
    rate_hz: u16,
    rows: u16,
    events: &[(u64, u16)],
    row: impl Fn(u16) -> Vec<f32>,
) -> NamedTempFile {
    let signals = model::LABELS.split(' ').map(|label| SignalToWrite {
        label: label.to_owned(),
        is_microvolt: true,
        is_integer: false,
        range: [-1e6, 1e6],
    });
    let description = FileToWrite {
        signals: signals.collect(),
        rate_hz: rate_hz.into(),
        rows_per_record: 1,
        start_ns: None,
        description: String::new(),
    };
    let mut file = NamedTempFile::with_suffix(".gdf").expect("a file");
    let mut writer = GdfWriter::new(file.as_file_mut(), &description).expect("a header");
    for at in 0..rows {
        writer.write_record(&row(at)).expect("a record");
    }
    writer
        .finish(events)
        .expect("a table")
        .flush()
        .expect("a file");
    file
}
