//! Which files of a folder a name means.

use crate::error::TrainerError;
use std::path::{Path, PathBuf};

/// Endings of files that may be recordings.
const ENDINGS: [&str; 3] = ["edf", "bdf", "gdf"];

/// The recordings of `folder` that `names` pick, sorted by name, each once.
///
/// A name picks the files whose stem or whole name ends with it; `R03..R10` stands for R03, R04,
/// ... R10.
///
/// # Errors
/// When the folder cannot be read, a range cannot be counted through or a name picks nothing.
pub fn recordings(folder: &Path, names: &[String]) -> Result<Vec<PathBuf>, TrainerError> {
    let error = |source| TrainerError::File {
        path: folder.to_owned(),
        source,
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        let ending = path
            .extension()
            .and_then(|ending| ending.to_str())
            .unwrap_or_default();
        if ENDINGS
            .iter()
            .any(|known| ending.eq_ignore_ascii_case(known))
        {
            files.push(path);
        }
    }
    files.sort();
    let mut picked = Vec::new();
    for name in expand(names)? {
        let before = picked.len();
        picked.extend(files.iter().filter(|path| picks(&name, path)).cloned());
        if picked.len() == before {
            let found = files.iter().map(|path| file_name(path)).collect();
            return Err(TrainerError::NothingFound {
                name,
                folder: folder.to_owned(),
                found,
            });
        }
    }
    picked.sort();
    picked.dedup();
    Ok(picked)
}

/// The last part of a path, as text.
pub fn file_name(path: &Path) -> String {
    path.file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

fn picks(name: &str, path: &Path) -> bool {
    let stem = path
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned());
    stem.is_some_and(|stem| stem.ends_with(name)) || file_name(path).ends_with(name)
}

/// Writes out the ranges among `names`.
fn expand(names: &[String]) -> Result<Vec<String>, TrainerError> {
    let mut expanded = Vec::new();
    for name in names {
        match name.split_once("..") {
            None => expanded.push(name.clone()),
            Some((first, last)) => {
                let range = || TrainerError::BadRange {
                    range: name.clone(),
                };
                let (prefix, from, width) = split_number(first).ok_or_else(range)?;
                let (last_prefix, to, _) = split_number(last).ok_or_else(range)?;
                if prefix != last_prefix || from > to {
                    return Err(range());
                }
                expanded.extend((from..=to).map(|number| format!("{prefix}{number:0width$}")));
            }
        }
    }
    Ok(expanded)
}

/// What stands in front of a number, the number and its digits.
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

    fn picked(folder: &Path, names: &[&str]) -> Result<Vec<String>, TrainerError> {
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        Ok(recordings(folder, &names)?
            .iter()
            .map(|path| file_name(path))
            .collect())
    }

    #[test]
    fn a_range_and_a_name_pick_files_by_the_end_of_their_stem() {
        let folder = folder(&[
            "S001R08.edf",
            "S001R09.edf",
            "S001R10.EDF",
            "S001R11.edf",
            "R09.txt",
        ]);
        let files = picked(folder.path(), &["R09..R10", "R09", "S001R11.edf"]).unwrap();
        assert_eq!(files, ["S001R09.edf", "S001R10.EDF", "S001R11.edf"]);
    }

    #[test]
    fn a_name_that_picks_nothing_is_an_error_that_lists_what_is_there() {
        let folder = folder(&["S001R08.edf"]);
        let error = picked(folder.path(), &["R08..R09"])
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("R09") && error.contains("S001R08.edf"),
            "{error}"
        );
    }

    #[test]
    fn ranges_that_cannot_be_counted_are_refused() {
        let folder = folder(&["S001R08.edf"]);
        for range in ["R10..R03", "R03..S05", "R..R5"] {
            let error = picked(folder.path(), &[range]).unwrap_err();
            assert!(
                matches!(error, TrainerError::BadRange { .. }),
                "{range}: {error}"
            );
        }
    }
}
