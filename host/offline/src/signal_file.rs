//! Files of decoded signals.

mod csv;
mod edf;
mod format;
mod gdf;
mod npz;
mod signal;

use std::fs::File;
use std::io;

pub use format::SignalFormat;
pub(crate) use signal::{RowEvent, Signal, SignalFile};

/// Creates the writer of a format.
///
/// # Errors
/// As [`SignalFile::write_hop`].
pub(crate) fn create(
    format: SignalFormat,
    file: File,
    signal: &Signal,
) -> io::Result<Box<dyn SignalFile>> {
    Ok(match format {
        SignalFormat::Edf => Box::new(edf::EdfFile::edf(file, signal)?),
        SignalFormat::Bdf => Box::new(edf::EdfFile::bdf(file, signal)?),
        SignalFormat::Gdf => Box::new(gdf::GdfFile::new(file, signal)?),
        SignalFormat::Npz => Box::new(npz::NpzFile::new(file, signal)?),
        SignalFormat::Csv => Box::new(csv::CsvFile::new(file, signal)?),
    })
}
