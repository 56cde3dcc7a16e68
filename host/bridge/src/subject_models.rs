//! The folder in which a user stores packed models that were fitted to people.

use std::ffi::OsString;
use std::fs::{self, File, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use artifact::{Artifact, ArtifactError};
use jiff::Timestamp;
use tempfile::TempDir;

use crate::error::BridgeError;

/// Path of the models relative to the user's data folder.
const NAME: &str = "corticode/models";
/// Format of a model's folder name: the UTC time, so that names sort by time.
const DATE: &str = "%Y-%m-%dT%H-%M-%SZ";

/// The models of all subjects: one folder for each subject, which holds one folder for each model.
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
    /// [`BridgeError::NoSubject`] if there is none, [`BridgeError::SubjectModels`] if a folder
    /// cannot be read.
    pub(crate) fn newest(&self, subject: &str) -> Result<PathBuf, BridgeError> {
        if let Some(newest) = newest_model(&self.folder.join(subject))? {
            return Ok(newest);
        }
        let mut known = Vec::new();
        for folder in folders(&self.folder)? {
            if newest_model(&folder)?.is_some() {
                let name = folder.file_name().unwrap_or_default();
                known.push(name.to_string_lossy().into_owned());
            }
        }
        Err(BridgeError::NoSubject {
            subject: subject.to_owned(),
            folder: self.folder.clone(),
            known,
        })
    }
}

/// Returns the newest complete model in the folder of a subject.
fn newest_model(subject: &Path) -> Result<Option<PathBuf>, BridgeError> {
    let mut models = folders(subject)?;
    models.retain(|folder| folder.join("model.toml").is_file());
    Ok(models.pop())
}

/// Returns the folders in `folder` whose names do not begin with a dot, sorted; none if `folder`
/// does not exist.
fn folders(folder: &Path) -> Result<Vec<PathBuf>, BridgeError> {
    let read = || -> io::Result<Vec<PathBuf>> {
        let mut folders = Vec::new();
        for entry in fs::read_dir(folder)? {
            let entry = entry?;
            if !entry.file_name().to_string_lossy().starts_with('.') && entry.path().is_dir() {
                folders.push(entry.path());
            }
        }
        folders.sort();
        Ok(folders)
    };
    read().or_else(|source| match source.kind() {
        io::ErrorKind::NotFound => Ok(Vec::new()),
        _ => Err(BridgeError::SubjectModels(folder.to_owned(), source)),
    })
}

/// Checks the name of a subject, which becomes the name of a folder.
///
/// # Errors
///
/// The reason why a visible folder cannot have this name.
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

/// A folder for a new model. The folder appears complete or not at all.
#[derive(Debug)]
pub(crate) struct NewModel {
    folder: PathBuf,
    /// Holds the files until all are written.
    unfinished: TempDir,
}

impl NewModel {
    /// Checks that a model can be written to `folder`, before there is a model.
    ///
    /// # Errors
    ///
    /// [`BridgeError::ModelFolder`] if the folder exists, or cannot be made.
    pub(crate) fn new(folder: PathBuf) -> Result<NewModel, BridgeError> {
        refuse_existing(&folder)?;
        let parent = match folder.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        let unfinished = fs::create_dir_all(parent).and_then(|()| {
            // Leave access to the umask, as for any new folder: a service of another user may use
            // the model.
            tempfile::Builder::new()
                .prefix(".corticode-")
                .permissions(Permissions::from_mode(0o777))
                .tempdir_in(parent)
        });
        match unfinished {
            Ok(unfinished) => Ok(NewModel { folder, unfinished }),
            Err(source) => Err(BridgeError::ModelFolder(folder, source)),
        }
    }

    /// Writes the model, and returns its folder.
    ///
    /// # Errors
    ///
    /// [`BridgeError::ModelFolder`] if the folder exists by now, or cannot be written.
    pub(crate) fn write(self, artifact: &Artifact) -> Result<PathBuf, BridgeError> {
        refuse_existing(&self.folder)?;
        match self.written(artifact) {
            Ok(()) => {
                // The folder has its final name now, so dropping `unfinished` must remove nothing.
                let _ = self.unfinished.keep();
                Ok(self.folder)
            }
            Err(source) => Err(BridgeError::ModelFolder(self.folder, source)),
        }
    }

    /// Writes the files, and then gives the folder its name. Syncs the files to the disk first:
    /// after a power failure, a folder with this name could otherwise hold empty files.
    fn written(&self, artifact: &Artifact) -> io::Result<()> {
        artifact.write(self.unfinished.path()).map_err(|error| match error {
            ArtifactError::File { source, .. } => source,
            error => io::Error::other(error),
        })?;
        for file in fs::read_dir(self.unfinished.path())? {
            File::open(file?.path())?.sync_all()?;
        }
        File::open(self.unfinished.path())?.sync_all()?;
        fs::rename(self.unfinished.path(), &self.folder)
    }
}

/// Returns [`BridgeError::ModelFolder`] if anything exists at this path.
fn refuse_existing(folder: &Path) -> Result<(), BridgeError> {
    let failed = |source| BridgeError::ModelFolder(folder.to_owned(), source);
    match folder.symlink_metadata() {
        Ok(_) => Err(failed(io::ErrorKind::AlreadyExists.into())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(failed(error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let models = SubjectModels { folder: folder.path().to_owned() };
        for model in ["ada/2026-01-02", "ada/2026-11-01", "bob/2026-12-01", "ada/.2027-01-01"] {
            let model = folder.path().join(model);
            fs::create_dir_all(&model).unwrap();
            fs::write(model.join("model.toml"), "").unwrap();
        }
        fs::create_dir(folder.path().join("ada/2026-12-01")).unwrap();
        // The model of this subject was never finished.
        fs::create_dir(folder.path().join("dan")).unwrap();
        let newest = models.newest("ada").unwrap();
        assert_eq!(newest, folder.path().join("ada/2026-11-01"));
        let error = models.newest("eve").unwrap_err().to_string();
        assert!(error.contains("no model of eve; it has models of ada, bob;"), "{error}");
        // A folder that cannot be read is an error of its own, not a subject without a model.
        fs::write(folder.path().join("mia"), "").unwrap();
        let error = models.newest("mia").unwrap_err();
        assert!(matches!(error, BridgeError::SubjectModels(..)), "{error}");
    }

    #[test]
    fn a_model_appears_whole_and_readable_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let names = || {
            let entries = fs::read_dir(folder.path().join("ada")).unwrap();
            let names = entries.map(|entry| entry.unwrap().file_name());
            names.collect::<Vec<_>>()
        };
        let artifact = bridge_core::Model::artifact(None).unwrap();
        let path = folder.path().join("ada/mine");
        drop(NewModel::new(path.clone()).unwrap());
        assert!(names().is_empty());
        let written = NewModel::new(path.clone()).unwrap().write(&artifact);
        assert_eq!(written.unwrap(), path);
        assert_eq!(names(), ["mine"]);
        assert_eq!(Artifact::read(&path).unwrap().id, artifact.id);
        fs::create_dir(folder.path().join("ada/other")).unwrap();
        let mode = |name: &str| {
            let path = folder.path().join("ada").join(name);
            path.metadata().unwrap().permissions().mode()
        };
        assert_eq!(mode("mine"), mode("other"));
        let error = NewModel::new(path).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
        let error = NewModel::new(folder.path().join("ada/mine/model.toml/x")).unwrap_err();
        assert_eq!(error.exit_code(), 1, "{error}");
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
