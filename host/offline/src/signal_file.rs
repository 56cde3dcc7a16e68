//! Writes decoded signals to files.

mod csv;
mod npz;
mod record;

use std::fs::File;
use std::io;
use std::ops::Range;

use link::Flags;

use crate::exclusions::Exclusions;

/// Format of a file of decoded signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalFormat {
    /// EDF+: 16 bits, tenths of a microvolt, +-3276.7 uV.
    Edf,
    /// BDF+: 24-bit values that span the ADC's full scale.
    Bdf,
    /// GDF 2.20: float32.
    Gdf,
    /// Arrays for `numpy.load`: float32.
    Npz,
    /// Comma-separated values, one line per step.
    Csv,
}

impl SignalFormat {
    /// Returns the extension of files in this format, without the dot.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Edf => "edf",
            Self::Bdf => "bdf",
            Self::Gdf => "gdf",
            Self::Npz => "npz",
            Self::Csv => "csv",
        }
    }
}

/// An event of the signal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RowEvent {
    /// Rows that the event covers; for an event without a duration, an empty range at its row.
    pub(crate) rows: Range<u64>,
    pub(crate) text: String,
    /// Type of the event in a GDF file; `None` if the event has only a text.
    pub(crate) kind: Option<u16>,
}

/// Description of a signal, which a file states before the first row.
#[derive(Debug, Clone)]
pub(crate) struct Signal<'a> {
    /// Electrodes, in the order of the values in a row.
    pub(crate) labels: &'a [String],
    /// Rows per second, Hz.
    pub(crate) rate_hz: u32,
    /// Number of rows in a hop. The rows of a hop are written together.
    pub(crate) rows_per_hop: u32,
    /// Number of rows of the whole signal.
    pub(crate) rows: u64,
    /// Group delay of the filters, microseconds: a row with the time t shows the potentials that
    /// the electrodes had at t minus the delay.
    pub(crate) group_delay_us: u32,
    /// Largest absolute value that a row can have, microvolts.
    pub(crate) full_scale_uv: f32,
    /// Electrodes that the device excluded.
    pub(crate) exclusions: &'a Exclusions,
    /// Events in the order of their rows.
    pub(crate) events: Vec<RowEvent>,
    /// Text that identifies the signal.
    pub(crate) description: String,
}

impl Signal<'_> {
    /// Returns the smallest and the largest possible value, microvolts.
    fn range_uv(&self) -> [f64; 2] {
        let full_scale_uv = f64::from(self.full_scale_uv);
        [-full_scale_uv, full_scale_uv]
    }
}

/// Writes the rows of a signal in a file format.
pub(crate) trait SignalFile {
    /// Writes one hop: [`Signal::rows_per_hop`] rows with a value for each electrode, and the flags
    /// that apply to all these rows. The error is the operating system's, or `InvalidInput` for
    /// values that the format cannot hold.
    fn write_hop(&mut self, uv: &[f32], flags: Flags) -> io::Result<()>;

    /// Completes the file. Returns the number of values that were limited to the format's range.
    fn finish(self: Box<Self>) -> io::Result<u64>;
}

/// Creates the writer for a format and writes the header of `signal` to `file`.
pub(crate) fn create(
    format: SignalFormat,
    file: File,
    signal: &Signal,
) -> io::Result<Box<dyn SignalFile>> {
    Ok(match format {
        SignalFormat::Edf | SignalFormat::Bdf => {
            Box::new(record::EdfFile::new(file, signal, format)?)
        }
        SignalFormat::Gdf => Box::new(record::GdfFile::new(file, signal)?),
        SignalFormat::Npz => Box::new(npz::NpzFile::new(file, signal)?),
        SignalFormat::Csv => Box::new(csv::CsvFile::new(file, signal)?),
    })
}
