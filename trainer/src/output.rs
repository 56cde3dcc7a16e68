//! Folders that a user names as output.

use crate::error::TrainerError;
use std::path::Path;

/// Creates a folder if necessary, and a file in it, which it deletes again.
///
/// # Errors
/// If the folder or the file cannot be created.
pub(crate) fn check_writable(folder: &Path) -> Result<(), TrainerError> {
    let probe = folder.join(format!(".trainer-{}", std::process::id()));
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&probe, ""))
        .and_then(|()| std::fs::remove_file(&probe))
        .map_err(|source| TrainerError::NotWritable(folder.to_owned(), source))
}

/// Refuses a folder that holds a model, unless it may be replaced.
///
/// # Errors
/// [`TrainerError::ArtifactExists`].
pub(crate) fn refuse_model(folder: &Path, force: bool) -> Result<(), TrainerError> {
    if !force && folder.join("model.toml").exists() {
        return Err(TrainerError::ArtifactExists(folder.to_owned()));
    }
    Ok(())
}
