//! Selects recordings by path, pattern or name.

use crate::error::TrainerError;
use crate::progress::ProgressObserver;
use crate::track::{Track, read_tracks};
use artifact::Description;
use clap::Args;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// File extensions of recordings.
const EXTENSIONS: [&str; 3] = ["edf", "bdf", "gdf"];

/// Names of recordings to train on and to test with.
#[derive(Args, Clone, Debug)]
pub struct TrainingFiles {
    /// Folder in which names of recordings are searched.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings (EDF, BDF, GDF) to train on: files, folders, patterns such as 'S001*.edf', ends
    /// of the names of files in --data, or ranges of them like R03..R10.
    #[arg(long, required = true, value_delimiter = ',')]
    train: Vec<String>,
    /// Recordings to test with; they are not used for training or validation. Without them the
    /// model has no test figures.
    #[arg(long, value_delimiter = ',')]
    test: Vec<String>,
    /// Mains frequency of the recordings, Hz: 50 or 60.
    #[arg(long = "mains", value_name = "MAINS", value_parser = mains_hz)]
    pub(crate) mains_hz: u32,
}

/// Names of recordings to evaluate a trained model on.
#[derive(Args, Clone, Debug)]
pub struct TestFiles {
    /// Folder in which names of recordings are searched [default: .].
    #[arg(long)]
    pub data: Option<PathBuf>,
    /// Recordings to test with: files, folders, patterns, ends of the names of files in --data, or
    /// ranges of them like R11..R12 [default: those in the training card].
    #[arg(long, value_delimiter = ',')]
    pub test: Vec<String>,
    /// Mains frequency of the recordings, Hz: 50 or 60 [default: that of the training].
    #[arg(long = "mains", value_name = "MAINS", value_parser = mains_hz)]
    pub mains_hz: Option<u32>,
}

impl TestFiles {
    /// Returns the folder in which names are searched.
    pub fn folder(&self) -> &Path {
        self.data.as_deref().unwrap_or(Path::new("."))
    }
}

/// Parses a mains frequency, Hz.
///
/// # Errors
/// Unless it is 50 or 60.
pub fn mains_hz(text: &str) -> Result<u32, String> {
    match text {
        "50" => Ok(50),
        "60" => Ok(60),
        _ => Err("mains are 50 or 60 Hz, for which the filters exist".to_owned()),
    }
}

/// Recordings to train on and to test with, none of them in both lists.
pub(crate) struct Selected {
    pub(crate) train: Vec<PathBuf>,
    pub(crate) test: Vec<PathBuf>,
    mains_hz: u32,
}

impl TrainingFiles {
    /// Finds the recordings.
    ///
    /// # Errors
    /// Those of [`recordings()`], and [`TrainerError::TrainedOn`] if one is both for training and
    /// for tests.
    pub(crate) fn find(&self) -> Result<Selected, TrainerError> {
        let train = recordings(&self.data, &self.train)?;
        let test = recordings(&self.data, &self.test)?;
        // A relative path and a symbolic link can denote the same recording.
        let trained: BTreeSet<_> = train.iter().map(|path| identity(path)).collect();
        if let Some(both) = test.iter().find(|path| trained.contains(&identity(path))) {
            return Err(TrainerError::TrainedOn(file_name(both)));
        }
        let mains_hz = self.mains_hz;
        Ok(Selected {
            train,
            test,
            mains_hz,
        })
    }
}

impl Selected {
    /// Reads some of the recordings.
    pub(crate) fn read(
        &self,
        files: &[PathBuf],
        description: &Description,
        observer: &mut impl ProgressObserver,
    ) -> Result<Vec<Track>, TrainerError> {
        read_tracks(files, description, self.mains_hz, observer)
    }

    /// Returns the file names of the recordings to train on, and of those to test with.
    pub(crate) fn names(&self) -> [Vec<String>; 2] {
        [&self.train, &self.test].map(|files| files.iter().map(|file| file_name(file)).collect())
    }
}

/// Returns the recordings that `names` select, sorted by path, without duplicates. A name is
///
/// * the path of a recording, or of a folder, which selects all recordings in it;
/// * a pattern of paths with `*`, `?` or `[...]`;
/// * the end of the stem or of the whole name of recordings in `folder`; `R03..R10` means R03, R04,
///   ... R10.
///
/// # Errors
/// If a folder cannot be read, a range cannot be expanded or a name selects no recording.
pub fn recordings(folder: &Path, names: &[String]) -> Result<Vec<PathBuf>, TrainerError> {
    let mut selected = Vec::new();
    for name in names {
        let path = Path::new(name);
        if path.is_file() {
            selected.push(path.to_owned());
        } else if path.is_dir() {
            selected.extend(all_in(path)?);
        } else if name.contains(['*', '?', '[']) {
            selected.extend(matching(name)?);
        } else {
            selected.extend(named(folder, name)?);
        }
    }
    selected.sort();
    let mut seen = BTreeSet::new();
    selected.retain(|path| seen.insert(identity(path)));
    Ok(selected)
}

/// Returns the absolute path without symbolic links; the path itself if the file cannot be reached.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Returns all recordings in a folder, sorted by name.
///
/// # Errors
/// If the folder cannot be read or has no recording.
pub fn all_in(folder: &Path) -> Result<Vec<PathBuf>, TrainerError> {
    let files = list(folder)?;
    if files.is_empty() {
        return Err(TrainerError::EmptyFolder(folder.to_owned()));
    }
    Ok(files)
}

fn list(folder: &Path) -> Result<Vec<PathBuf>, TrainerError> {
    let error = TrainerError::file(folder);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        if is_recording(&path) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Returns the recordings whose path matches a pattern.
fn matching(pattern: &str) -> Result<Vec<PathBuf>, TrainerError> {
    let paths = glob::glob(pattern)
        .map_err(|source| TrainerError::BadPattern(pattern.to_owned(), source))?;
    let mut files = Vec::new();
    for path in paths {
        let path =
            path.map_err(|error| TrainerError::File(error.path().to_owned(), error.into()))?;
        if is_recording(&path) {
            files.push(path);
        }
    }
    if files.is_empty() {
        return Err(TrainerError::NothingMatches(pattern.to_owned()));
    }
    Ok(files)
}

/// Returns the recordings in a folder whose stem or name ends with a name or a range of names.
fn named(folder: &Path, name: &str) -> Result<Vec<PathBuf>, TrainerError> {
    let files = list(folder)?;
    let mut selected = Vec::new();
    for name in expand(name)? {
        let before = selected.len();
        selected.extend(files.iter().filter(|path| matches(&name, path)).cloned());
        if selected.len() == before {
            return Err(TrainerError::NothingFound {
                name,
                folder: folder.to_owned(),
                found: files.iter().map(|path| file_name(path)).collect(),
            });
        }
    }
    Ok(selected)
}

fn is_recording(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    let is = |known: &&str| extension.is_some_and(|found| found.eq_ignore_ascii_case(known));
    EXTENSIONS.iter().any(is)
}

/// Returns the last component of a path as text.
pub fn file_name(path: &Path) -> String {
    path.file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

fn matches(name: &str, path: &Path) -> bool {
    let stem = path
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned());
    stem.is_some_and(|stem| stem.ends_with(name)) || file_name(path).ends_with(name)
}

/// Returns the names in a range, for example R03, R04 and R05 for `R03..R05`; a name that is no
/// range is returned alone.
fn expand(name: &str) -> Result<Vec<String>, TrainerError> {
    let Some((first, last)) = name.split_once("..") else {
        return Ok(vec![name.to_owned()]);
    };
    let range = || TrainerError::BadRange(name.to_owned());
    let (prefix, from, width) = split_number(first).ok_or_else(range)?;
    let (last_prefix, to, _) = split_number(last).ok_or_else(range)?;
    if prefix != last_prefix || from > to {
        return Err(range());
    }
    Ok((from..=to)
        .map(|number| format!("{prefix}{number:0width$}"))
        .collect())
}

/// Splits a name into the prefix, the number at its end, and the number of digits; `None` if the
/// name does not end with a number.
fn split_number(name: &str) -> Option<(&str, u32, usize)> {
    let prefix = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let digits = &name[prefix.len()..];
    digits
        .parse()
        .ok()
        .map(|number| (prefix, number, digits.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            std::fs::write(folder.path().join(file), b"").unwrap();
        }
        folder
    }

    fn matching(folder: &Path, names: &[&str]) -> Result<Vec<String>, TrainerError> {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        Ok(recordings(folder, &names)?
            .iter()
            .map(|path| file_name(path))
            .collect())
    }

    #[test]
    fn ranges_and_names_match_files_by_the_end_of_their_stem() {
        let folder = folder(&[
            "S001R08.edf",
            "S001R09.edf",
            "S001R10.EDF",
            "S001R11.edf",
            "R09.txt",
        ]);
        let files = matching(folder.path(), &["R09..R10", "R09", "S001R11.edf"]).unwrap();
        assert_eq!(files, ["S001R09.edf", "S001R10.EDF", "S001R11.edf"]);
    }

    #[test]
    fn the_error_of_a_name_without_match_lists_the_recordings() {
        let folder = folder(&["S001R08.edf"]);
        let error = matching(folder.path(), &["R08..R09"])
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("R09") && error.contains("S001R08.edf"),
            "{error}"
        );
    }

    #[test]
    fn files_folders_and_patterns_select_recordings_wherever_they_are() {
        let folder = folder(&["a1.edf", "a2.bdf", "b1.gdf", "notes.txt"]);
        let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
        let select = |names: &[String]| -> Result<Vec<String>, TrainerError> {
            let files = recordings(Path::new("/nowhere"), names)?;
            Ok(files.iter().map(|path| file_name(path)).collect())
        };
        assert_eq!(select(&[path("b1.gdf")]).unwrap(), ["b1.gdf"]);
        assert_eq!(select(&[path("")]).unwrap(), ["a1.edf", "a2.bdf", "b1.gdf"]);
        assert_eq!(
            select(&[path("a*"), path("a1.edf")]).unwrap(),
            ["a1.edf", "a2.bdf"]
        );
        let error = select(&[path("c*")]).unwrap_err().to_string();
        assert!(
            error.contains("c*") && error.contains("no recording"),
            "{error}"
        );
        let error = select(&["a[".to_owned()]).unwrap_err();
        assert!(matches!(error, TrainerError::BadPattern(..)), "{error}");
    }

    #[test]
    fn ranges_that_cannot_be_expanded_are_refused() {
        let folder = folder(&["S001R08.edf"]);
        for range in ["R10..R03", "R03..S05", "R..R5"] {
            let error = matching(folder.path(), &[range]).unwrap_err();
            assert!(
                matches!(error, TrainerError::BadRange(_)),
                "{range}: {error}"
            );
        }
    }
}
