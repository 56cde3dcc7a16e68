//! GDF recordings that tests write, pseudo-random values for them, and CSV tables that tests read.

use std::fs::{self, File};
use std::path::Path;

use recordings::{FileToWrite, GdfWriter, SignalToWrite};

/// Writes a GDF file with one signal for each label in `labels`.
///
/// `values` are in microvolts, sample by sample, and must fill whole seconds; each pair in `events`
/// is the number of a sample and the code of an event.
///
/// # Panics
/// When the file cannot be written.
pub fn write_gdf<L: AsRef<str>>(
    path: &Path,
    labels: &[L],
    rate_hz: u32,
    values: impl Iterator<Item = f32>,
    events: &[(u64, u16)],
) {
    let signal = |label: &L| SignalToWrite {
        label: label.as_ref().to_owned(),
        is_microvolt: true,
        is_integer: false,
        range: [-187_500.0, 187_500.0],
    };
    let file = FileToWrite {
        signals: labels.iter().map(signal).collect(),
        rate_hz,
        rows_per_record: rate_hz,
        start_ns: None,
        description: "test".to_owned(),
    };
    let writer = GdfWriter::new(File::create(path).expect("a new file"), &file);
    let mut writer = writer.expect("a header");
    let values: Vec<f32> = values.collect();
    let second = labels.len() * usize::try_from(rate_hz).expect("a rate");
    for record in values.chunks_exact(second) {
        writer.write_record(record).expect("a record");
    }
    writer.finish(events).expect("a whole file");
}

/// Returns a source of pseudo-random numbers from -1 to 1: a linear congruential generator with the
/// constants of Numerical Recipes.
pub fn noise(seed: u32) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(i16::from_be_bytes([state.to_be_bytes()[0], state.to_be_bytes()[1]])) / 32_768.0
    }
}

/// A table with the names of its columns, read from a CSV file.
#[derive(Debug)]
pub struct Table {
    /// Names of the columns.
    pub names: Vec<String>,
    /// Cells of each row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Reads a CSV file with the names of its columns in the first line; skips lines that start
    /// with `#`.
    ///
    /// # Panics
    /// When the file cannot be read, or has no names.
    pub fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        let mut lines = lines.map(|line| line.split(',').map(str::to_owned).collect());
        let names = lines.next().expect("names of columns");
        let rows = lines.collect();
        Self { names, rows }
    }

    /// Returns, row by row, the numbers in the columns called `names`.
    ///
    /// # Panics
    /// When a column is missing, or a cell is not a number.
    pub fn numbers<'t>(&'t self, names: &[&str]) -> impl Iterator<Item = Vec<f32>> + 't {
        let place = |name: &&str| self.names.iter().position(|other| other == name);
        let places: Vec<usize> = names
            .iter()
            .map(|name| place(name).unwrap_or_else(|| panic!("{name}: {:?}", self.names)))
            .collect();
        let number = |cell: &String| cell.parse().expect("a number");
        let row = move |row: &Vec<String>| places.iter().map(|p| number(&row[*p])).collect();
        self.rows.iter().map(row)
    }
}
