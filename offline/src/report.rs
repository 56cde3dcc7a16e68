//! The report of decoded recordings: pictures, a table, and a page that shows them.

mod entry;
mod page;
mod pictures;
mod table;

use std::fs;
use std::path::Path;

use artifact::Description;

use crate::error::OfflineError;
pub use entry::Entry;

/// Writes the report of `entries` to `folder`, which is created: `index.html`, `electrodes.csv`, and the
/// pictures of each recording in a folder with its name. Entries without a comparison have no error and no
/// traces. Files of an earlier report are replaced.
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
        ("index.html", page::page(description, entries)),
        ("electrodes.csv", table::electrodes(description, entries)),
    ] {
        let path = folder.join(name);
        fs::write(&path, text).map_err(OfflineError::write(&path))?;
    }
    Ok(())
}
