//! Writes the report of decoded recordings: pictures, a table, and a page that shows them.

mod page;
mod pictures;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use artifact::Description;
use new_file::{Existing, NewFileError};
use picture::page::csv_field;

use crate::comparison::Comparison;
use crate::decoding::Decoded;
use crate::error::OfflineError;

/// File name of the report's page.
const PAGE: &str = "index.html";
/// File name of the table that has the errors of all electrodes.
const TABLE: &str = "electrodes.csv";

/// A decoded recording, with its name in the report.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Name, such as "S001/S001R11". It is also the path of the folder with the recording's
    /// pictures, relative to the folder of the report.
    pub name: String,
    /// Result of decoding the recording's codes.
    pub decoded: Decoded,
}

impl Entry {
    /// Returns the comparison with the original; `None` without an original, or if no step could be
    /// compared.
    fn compared(&self) -> Option<&Comparison> {
        let comparison = self.decoded.comparison.as_ref();
        comparison.filter(|comparison| comparison.steps > 0)
    }
}

/// Checks that the folder may receive a report, and creates it.
///
/// # Errors
/// [`OfflineError::NewFile`] if the folder holds a report already and `existing` does not allow
/// replacing it; [`OfflineError::Write`] if the folder cannot be created.
pub fn check(folder: &Path, existing: Existing) -> Result<(), OfflineError> {
    for path in [PAGE, TABLE].map(|name| folder.join(name)) {
        if path.exists() && existing == Existing::Refuse {
            return Err(NewFileError::Exists { path }.into());
        }
    }
    fs::create_dir_all(folder).map_err(OfflineError::write(folder))
}

/// Writes the report of `entries` to `folder`, and creates the folder if necessary: `index.html`,
/// `electrodes.csv`, and the pictures of each recording in a folder with its name. Entries without
/// a comparison show no errors and no traces. Replaces the files of an earlier report; a caller
/// that must not replace them calls [`check`] first.
///
/// # Errors
/// [`OfflineError::Write`] or [`OfflineError::Picture`] if a file cannot be written.
pub fn write(
    folder: &Path,
    description: &Description,
    entries: &[Entry],
) -> Result<(), OfflineError> {
    for entry in entries {
        let pictures = folder.join(&entry.name);
        fs::create_dir_all(&pictures).map_err(OfflineError::write(&pictures))?;
        pictures::draw(&pictures, description, entry)?;
    }
    for (name, text) in
        [(PAGE, page::page(description, entries)), (TABLE, electrodes(description, entries))]
    {
        let path = folder.join(name);
        fs::write(&path, text).map_err(OfflineError::write(&path))?;
    }
    Ok(())
}

/// Returns the table as CSV: one line for each recording and electrode.
fn electrodes(description: &Description, entries: &[Entry]) -> String {
    let mut text = "recording,electrode,origin,steps,mse,mse_uv2,prd_percent\n".to_owned();
    let unit = description.input.sd_uv.powi(2);
    for entry in entries {
        let Some(comparison) = entry.compared() else {
            continue;
        };
        let labels = description.montage.electrodes.iter();
        let errors = comparison.electrodes.iter().zip(&comparison.origins);
        for (label, (error, origin)) in labels.zip(errors) {
            let mse_uv2 = error.mse_uv2();
            // Writing to a string never fails.
            let _ = writeln!(
                text,
                "{},{label},{origin},{},{},{mse_uv2},{}",
                csv_field(&entry.name),
                error.steps,
                mse_uv2 / unit,
                error.prd_percent()
            );
        }
    }
    text
}
