//! The folder in which a user keeps packed models that were fitted to people.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use artifact::Artifact;
use jiff::Timestamp;

use crate::error::BridgeError;

/// Path of the models below a user's folder for data.
const NAME: &str = "corticode/models";
/// Form of the name of a model's folder: the time in UTC, so that names are sorted by time.
const DATE: &str = "%Y-%m-%dT%H-%M-%SZ";

/// The models of all subjects, one folder for each subject, in it one folder for each model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SubjectModels {
    folder: PathBuf,
}

impl SubjectModels {
    /// Finds the folder of the user as the XDG Base Directory Specification says. `variable`
    /// returns the value of an environment variable.
    ///
    /// # Errors
    ///
    /// [`BridgeError::NoDataFolder`] if neither `XDG_DATA_HOME` nor `HOME` is an absolute path.
    pub(crate) fn of_user(
        variable: impl Fn(&str) -> Option<OsString>,
    ) -> Result<SubjectModels, BridgeError> {
        let absolute = |name: &str| {
            let path = variable(name).map(PathBuf::from);
            path.filter(|path| path.is_absolute())
        };
        let in_home = || absolute("HOME").map(|home| home.join(".local/share"));
        let data = absolute("XDG_DATA_HOME").or_else(in_home);
        let folder = data.ok_or(BridgeError::NoDataFolder)?.join(NAME);
        Ok(SubjectModels { folder })
    }

    /// Returns the folder of a new model of `subject`, made at the time `now`.
    pub(crate) fn new_folder(&self, subject: &str, now: Timestamp) -> PathBuf {
        let date = now.strftime(DATE).to_string();
        self.folder.join(subject).join(date)
    }

    /// Returns the folder of the newest model of `subject`.
    ///
    /// # Errors
    ///
    /// [`BridgeError::NoSubject`] if there is none.
    pub(crate) fn newest(&self, subject: &str) -> Result<PathBuf, BridgeError> {
        let models = folders(&self.folder.join(subject));
        let models = models
            .into_iter()
            .filter(|folder| folder.join("model.toml").is_file());
        models.max().ok_or_else(|| BridgeError::NoSubject {
            subject: subject.to_owned(),
            folder: self.folder.clone(),
            known: folders(&self.folder)
                .iter()
                .filter_map(|folder| Some(folder.file_name()?.to_string_lossy().into_owned()))
                .collect(),
        })
    }
}

/// Returns the folders in `folder` whose names do not begin with a dot, sorted; none if it cannot
/// be read.
fn folders(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let visible = entries.filter(|entry| !entry.file_name().to_string_lossy().starts_with('.'));
    let folders = visible
        .map(|entry| entry.path())
        .filter(|path| path.is_dir());
    let mut folders: Vec<PathBuf> = folders.collect();
    folders.sort();
    folders
}

/// Checks the name of a subject, which becomes that of a folder.
///
/// # Errors
///
/// The reason, for a name that cannot be that of a visible folder.
pub(crate) fn subject_name(text: &str) -> Result<String, String> {
    if text.is_empty() || text.starts_with('.') || text.contains(['/', '\0']) {
        return Err(
            "it becomes the name of a folder: it has at least one character, no slash, and does not begin \
             with a dot"
                .to_owned(),
        );
    }
    Ok(text.to_owned())
}

/// Writes a model to a new folder, which appears complete or not at all.
///
/// # Errors
///
/// [`BridgeError::ModelFolder`] if the folder exists or cannot be written.
pub(crate) fn write_new(artifact: &Artifact, folder: &Path) -> Result<(), BridgeError> {
    refuse_existing(folder)?;
    let failed = |source| BridgeError::ModelFolder {
        folder: folder.to_owned(),
        source,
    };
    let parent = match folder.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(parent).map_err(failed)?;
    let unfinished = tempfile::Builder::new()
        .prefix(".corticode-")
        .tempdir_in(parent);
    let unfinished = unfinished.map_err(failed)?;
    artifact
        .write(unfinished.path())
        .map_err(BridgeError::Model)?;
    std::fs::rename(unfinished.path(), folder).map_err(failed)?;
    // The folder has its name now, so there is nothing to remove.
    let _ = unfinished.keep();
    Ok(())
}

/// # Errors
///
/// [`BridgeError::ModelFolder`] if something with the name of the folder exists.
pub(crate) fn refuse_existing(folder: &Path) -> Result<(), BridgeError> {
    if folder.symlink_metadata().is_err() {
        return Ok(());
    }
    Err(BridgeError::ModelFolder {
        folder: folder.to_owned(),
        source: std::io::ErrorKind::AlreadyExists.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn models_lie_below_the_folder_for_data() {
        let of_user = |variables: &[(&str, &str)]| {
            let find = |name: &str| {
                let found = variables.iter().find(|(known, _)| *known == name);
                found.map(|(_, value)| OsString::from(value))
            };
            let models = SubjectModels::of_user(find);
            models.map(|models| models.new_folder("ada", Timestamp::constant(1_700_000_000, 0)))
        };
        let home = ("HOME", "/home/ada");
        let in_home = "/home/ada/.local/share/corticode/models/ada/2023-11-14T22-13-20Z";
        assert_eq!(of_user(&[home]).unwrap(), Path::new(in_home));
        // The XDG specification says that a relative path shall be ignored.
        let relative = ("XDG_DATA_HOME", "data");
        assert_eq!(of_user(&[home, relative]).unwrap(), Path::new(in_home));
        let folder = of_user(&[home, ("XDG_DATA_HOME", "/data")]).unwrap();
        assert!(folder.starts_with("/data/corticode/models/ada"));
        let error = of_user(&[relative]).unwrap_err().to_string();
        assert!(error.contains("XDG_DATA_HOME nor HOME"), "{error}");
    }

    #[test]
    fn the_newest_complete_model_is_found_and_a_missing_one_names_the_others() {
        let folder = tempfile::tempdir().unwrap();
        let models = SubjectModels {
            folder: folder.path().to_owned(),
        };
        for model in [
            "ada/2026-01-02",
            "ada/2026-11-01",
            "bob/2026-12-01",
            "ada/.2027-01-01",
        ] {
            let model = folder.path().join(model);
            fs::create_dir_all(&model).unwrap();
            fs::write(model.join("model.toml"), "").unwrap();
        }
        fs::create_dir(folder.path().join("ada/2026-12-01")).unwrap();
        let newest = models.newest("ada").unwrap();
        assert_eq!(newest, folder.path().join("ada/2026-11-01"));
        let error = models.newest("eve").unwrap_err().to_string();
        assert!(
            error.contains("no model of eve; it has models of ada, bob;"),
            "{error}"
        );
    }

    #[test]
    fn a_subject_s_name_is_that_of_a_visible_folder() {
        for name in ["", ".", "..", ".ada", "a/b", "/etc"] {
            assert!(subject_name(name).is_err(), "{name}");
        }
        for name in ["S001", "Ada L.", "\u{e9}va"] {
            assert_eq!(subject_name(name).as_deref(), Ok(name));
        }
    }
}
