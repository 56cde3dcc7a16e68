//! Resolves names that a user gives: recordings by path, pattern or name, and folders to write to.

use crate::error::TrainerError;
use clap::Args;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// File extensions of recordings, in lower case.
const EXTENSIONS: [&str; 3] = ["edf", "bdf", "gdf"];

/// Names of recordings to train on and to test with.
#[derive(Args, Clone, Debug)]
pub(crate) struct TrainingFiles {
    /// Folder in which recordings are looked up by name, or a pattern of folders such as
    /// 'data/S0*'.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings (EDF, BDF, GDF) to train on: files, folders, patterns such as 'S001*.edf', or how
    /// file names in --data end, such as R03 or the range R03..R10.
    #[arg(long, required = true, value_delimiter = ',')]
    train: Vec<String>,
    /// Recordings to test with; they are not used for training or validation. Without them the
    /// model has no test figures.
    #[arg(long, value_delimiter = ',')]
    test: Vec<String>,
    /// Name of the person in all recordings [default: the text before the run's number in each file
    /// name]. In training, each person's recordings are scaled to the same power.
    #[arg(long)]
    pub(crate) subject: Option<String>,
    /// Mains frequency of the recordings, Hz: 50 or 60.
    #[arg(long = "mains", value_name = "MAINS", value_parser = mains_hz)]
    pub(crate) mains_hz: u32,
}

/// Names of recordings to evaluate a trained model on.
#[derive(Args, Clone, Debug, Default)]
pub struct TestFiles {
    /// Folder in which recordings are looked up by name, or a pattern of folders such as 'data/S0*'
    /// [default: .].
    #[arg(long)]
    pub data: Option<PathBuf>,
    /// Recordings to test with: files, folders, patterns, or how file names in --data end, such as
    /// R11 or the range R11..R12 [default: those in the training card].
    #[arg(long, value_delimiter = ',')]
    pub test: Vec<String>,
    /// Name of the person in all recordings [default: the text before the run's number in each file
    /// name].
    #[arg(long)]
    pub subject: Option<String>,
    /// Mains frequency of the recordings, Hz: 50 or 60 [default: the mains frequency of the
    /// training data].
    #[arg(long = "mains", value_name = "MAINS", value_parser = mains_hz)]
    pub mains_hz: Option<u32>,
}

impl TestFiles {
    /// Returns the folder in which recordings are looked up by name.
    pub(crate) fn folder(&self) -> &Path {
        self.data.as_deref().unwrap_or(Path::new("."))
    }
}

/// Parses a mains frequency, Hz.
///
/// # Errors
/// If the frequency is neither 50 nor 60 Hz.
pub(crate) fn mains_hz(text: &str) -> Result<u32, String> {
    match text {
        "50" => Ok(50),
        "60" => Ok(60),
        _ => Err("mains are 50 or 60 Hz, for which the filters exist".to_owned()),
    }
}

/// Recordings for training and tests; no recording is in both lists.
pub(crate) struct Selected {
    pub(crate) train: Vec<PathBuf>,
    pub(crate) test: Vec<PathBuf>,
}

impl TrainingFiles {
    /// Finds the recordings for training and tests.
    ///
    /// # Errors
    /// If [`recordings()`] fails; [`TrainerError::TrainedOn`] if a recording is named both for
    /// training and for tests.
    pub(crate) fn find(&self) -> Result<Selected, TrainerError> {
        let train = recordings(&self.data, &self.train)?;
        let test = recordings(&self.data, &self.test)?;
        // Compare real paths: a relative path and a symbolic link can denote the same recording.
        let trained: BTreeSet<_> = train.iter().map(|path| identity(path)).collect();
        if let Some(both) = test.iter().find(|path| trained.contains(&identity(path))) {
            return Err(TrainerError::TrainedOn(file_name(both)));
        }
        Ok(Selected { train, test })
    }
}

impl Selected {
    /// Returns the file names of the training recordings and of the test recordings.
    pub(crate) fn names(&self) -> [Vec<String>; 2] {
        [&self.train, &self.test].map(|files| files.iter().map(|file| file_name(file)).collect())
    }
}

/// Checks that files can be written to a folder: creates the folder if necessary and a file in it,
/// and deletes the file again.
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

/// Returns an error if a folder already holds a model and `force` is false.
///
/// # Errors
/// [`TrainerError::ArtifactExists`] for such a folder.
pub(crate) fn refuse_model(folder: &Path, force: bool) -> Result<(), TrainerError> {
    if !force && folder.join("model.toml").exists() {
        return Err(TrainerError::ArtifactExists(folder.to_owned()));
    }
    Ok(())
}

/// Returns the recordings that `names` select, sorted by path, without duplicates. A name is one
/// of:
///
/// * the path of a recording, or of a folder, which selects all recordings in it;
/// * a pattern of paths with `*`, `?` or `[...]`;
/// * the end of file names in `folder`, with or without extension; `folder` may be a pattern of
///   folders, and `R03..R10` means R03, R04, ... R10, each of which must match a recording.
///
/// # Errors
/// If a folder cannot be read, a range cannot be expanded or a name selects no recording.
pub(crate) fn recordings(folder: &Path, names: &[String]) -> Result<Vec<PathBuf>, TrainerError> {
    let mut selected = Vec::new();
    for name in names {
        let path = Path::new(name);
        if path.is_file() {
            selected.push(path.to_owned());
        } else if path.is_dir() {
            selected.extend(all_in(path)?);
        } else if is_pattern(name) {
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

/// Returns the absolute path without symbolic links, or `path` itself if the file cannot be
/// accessed.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Returns all recordings in a folder, or in all folders that match a pattern, sorted by path.
///
/// # Errors
/// If a folder cannot be read or there is no recording.
pub(crate) fn all_in(folder: &Path) -> Result<Vec<PathBuf>, TrainerError> {
    let files = list(folder)?;
    if files.is_empty() {
        return Err(TrainerError::EmptyFolder(folder.to_owned()));
    }
    Ok(files)
}

/// Returns the recordings in a folder, or in all folders that match a pattern.
fn list(folder: &Path) -> Result<Vec<PathBuf>, TrainerError> {
    let name = folder.to_string_lossy();
    let folders = if !folder.is_dir() && is_pattern(&name) {
        let mut folders = paths(&name)?;
        folders.retain(|path| path.is_dir());
        folders
    } else {
        vec![folder.to_owned()]
    };
    let mut files = Vec::new();
    for folder in folders {
        let error = TrainerError::file(&folder);
        for entry in std::fs::read_dir(&folder).map_err(error)? {
            let path = entry.map_err(error)?.path();
            if is_recording(&path) {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// Returns the recordings whose path matches a pattern.
fn matching(pattern: &str) -> Result<Vec<PathBuf>, TrainerError> {
    let mut files = paths(pattern)?;
    files.retain(|path| is_recording(path));
    if files.is_empty() {
        return Err(TrainerError::NothingMatches(pattern.to_owned()));
    }
    Ok(files)
}

/// Returns all paths that match a pattern, sorted.
fn paths(pattern: &str) -> Result<Vec<PathBuf>, TrainerError> {
    let paths = glob::glob(pattern)
        .map_err(|source| TrainerError::BadPattern(pattern.to_owned(), source))?;
    paths
        .map(|path| path.map_err(|error| TrainerError::File(error.path().to_owned(), error.into())))
        .collect()
}

fn is_pattern(name: &str) -> bool {
    name.contains(['*', '?', '['])
}

/// Returns the recordings in a folder whose file name, with or without extension, ends with `name`.
/// If `name` is a range, returns the recordings for each name in the range.
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
    let extension = path.extension().unwrap_or_default();
    EXTENSIONS.iter().any(|known| extension.eq_ignore_ascii_case(known))
}

/// Returns the last component of a path as text.
pub(crate) fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Returns whether the name of a file, with or without its extension, ends with `name`.
fn matches(name: &str, path: &Path) -> bool {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    stem.ends_with(name) || file_name(path).ends_with(name)
}

/// Returns the names in a range, for example R03, R04 and R05 for `R03..R05`. Returns `name` alone
/// if it is not a range.
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
    Ok((from..=to).map(|number| format!("{prefix}{number:0width$}")).collect())
}

/// Splits a name into the text before the number at its end, this number, and the number of its
/// digits. Returns `None` if the name does not end with a number.
fn split_number(name: &str) -> Option<(&str, u32, usize)> {
    let prefix = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let digits = &name[prefix.len()..];
    Some((prefix, digits.parse().ok()?, digits.len()))
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

    /// Returns the file names of the recordings that `names` select in a folder.
    fn select(folder: &Path, names: &[&str]) -> Result<Vec<String>, TrainerError> {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        let files = recordings(folder, &names)?;
        Ok(files.iter().map(|path| file_name(path)).collect())
    }

    #[test]
    fn ranges_and_names_match_files_by_the_end_of_their_stem() {
        let files = ["S001R08.edf", "S001R09.edf", "S001R10.EDF", "S001R11.edf", "R09.txt"];
        let folder = folder(&files);
        let select = |names: &[&str]| select(folder.path(), names);
        let files = select(&["R09..R10", "R09", "S001R11.edf"]).unwrap();
        assert_eq!(files, ["S001R09.edf", "S001R10.EDF", "S001R11.edf"]);
        let error = select(&["R11..R12"]).unwrap_err().to_string();
        assert!(error.contains("R12") && error.contains("S001R08.edf"), "{error}");
        for range in ["R10..R03", "R03..S05", "R..R5"] {
            let error = select(&[range]).unwrap_err();
            assert!(matches!(error, TrainerError::BadRange(_)), "{error}");
        }
    }

    #[test]
    fn files_folders_and_patterns_select_recordings_wherever_they_are() {
        let folder = folder(&["a1.edf", "a2.bdf", "b1.gdf", "notes.txt"]);
        let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
        for (names, expected) in [
            (["b1.gdf", "b1.gdf"], &["b1.gdf"][..]),
            (["", ""], &["a1.edf", "a2.bdf", "b1.gdf"]),
            (["a*", "a1.edf"], &["a1.edf", "a2.bdf"]),
        ] {
            let names = names.map(path);
            let found = select(Path::new("/nowhere"), &names.each_ref().map(String::as_str));
            assert_eq!(found.unwrap(), expected);
        }
        let error = select(Path::new("/nowhere"), &[&path("c*")]).unwrap_err();
        assert!(matches!(error, TrainerError::NothingMatches(_)), "{error}");
        let error = select(Path::new("/nowhere"), &["a["]).unwrap_err();
        assert!(matches!(error, TrainerError::BadPattern(..)), "{error}");
    }
}
