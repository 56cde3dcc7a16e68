//! Writes GDF files with the electrodes of the model.

use std::io::Write as _;

use recordings::{FileToWrite, GdfWriter};
use tempfile::NamedTempFile;

/// Writes a GDF file of `rows` rows, whose microvolts `row` returns; `events` are pairs (row,
/// type).
pub(crate) fn gdf_file(
    rate_hz: u16,
    rows: u16,
    events: &[(u64, u16)],
    row: impl Fn(u16) -> Vec<f32>,
) -> NamedTempFile {
    let labels = model::LABELS.split(' ');
    let description = FileToWrite::microvolts(labels, [-1e6, 1e6], rate_hz.into(), 1);
    let mut file = NamedTempFile::with_suffix(".gdf").expect("a file");
    let mut writer = GdfWriter::new(file.as_file_mut(), &description).expect("a header");
    for at in 0..rows {
        writer.write_record(&row(at)).expect("a record");
    }
    writer.finish(events).expect("a table").flush().expect("a file");
    file
}
