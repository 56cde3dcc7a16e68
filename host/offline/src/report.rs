//! The report of decoded recordings: pictures, a table, and a page that shows them.

mod entry;
mod page;
mod pictures;
mod table;

use std::fs;
use std::path::Path;

use artifact::Description;
use new_file::{Existing, NewFileError};

use crate::error::OfflineError;
pub use entry::Entry;

/// File name of the page.
const PAGE: &str = "index.html";
/// File name of the errors of all electrodes.
const TABLE: &str = "electrodes.csv";

/// Creates the folder of a report.
///
/// # Errors
/// [`OfflineError::NewFile`] if the folder holds a report already and `existing` does not allow to replace it;
/// [`OfflineError::Write`] if the folder cannot be created.
pub fn check(folder: &Path, existing: Existing) -> Result<(), OfflineError> {
    for path in [PAGE, TABLE].map(|name| folder.join(name)) {
        if path.exists() && existing == Existing::Refuse {
            return Err(NewFileError::Exists { path }.into());
        }
    }
    fs::create_dir_all(folder).map_err(OfflineError::write(folder))
}

/// Writes the report of `entries` to `folder`, which is created: `index.html`, `electrodes.csv`, and the
/// pictures of each recording in a folder with its name. Entries without a comparison have no error and no
/// traces. Files of an earlier report are replaced; [`check`] refuses that before the work begins.
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
    for (name, text) in [
        (PAGE, page::page(description, entries)),
        (TABLE, table::electrodes(description, entries)),
    ] {
        let path = folder.join(name);
        fs::write(&path, text).map_err(OfflineError::write(&path))?;
    }
    Ok(())
}
