//! Selects recordings in a folder by name.

use crate::error::TrainerError;
use std::path::{Path, PathBuf};

/// File extensions of recordings.
const EXTENSIONS: [&str; 3] = ["edf", "bdf", "gdf"];

/// Returns the recordings in `folder` that match `names`, sorted by name, without duplicates.
///
/// A name matches the files whose stem or whole name ends with it; `R03..R10` means R03, R04, ... R10.
///
/// # Errors
/// If the folder cannot be read, a range cannot be expanded or a name matches no file.
pub fn recordings(folder: &Path, names: &[String]) -> Result<Vec<PathBuf>, TrainerError> {
    let error = |source| TrainerError::File {
        path: folder.to_owned(),
        source,
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        let extension = path
            .extension()
            .and_then(|extension| extension.to_str())
            .unwrap_or_default();
        if EXTENSIONS
            .iter()
            .any(|known| extension.eq_ignore_ascii_case(known))
        {
            files.push(path);
        }
    }
    files.sort();
    let mut matching = Vec::new();
    for name in expand(names)? {
        let before = matching.len();
        matching.extend(files.iter().filter(|path| matches(&name, path)).cloned());
        if matching.len() == before {
            let found = files.iter().map(|path| file_name(path)).collect();
            return Err(TrainerError::NothingFound {
                name,
                folder: folder.to_owned(),
                found,
            });
        }
    }
    matching.sort();
    matching.dedup();
    Ok(matching)
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

/// Replaces each range in `names` by the names in it, for example `R03..R05` by R03, R04 and R05.
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

/// Splits a name into the prefix, the number at its end, and the number of digits; `None` if the name
/// does not end with a number.
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
    fn ranges_that_cannot_be_expanded_are_refused() {
        let folder = folder(&["S001R08.edf"]);
        for range in ["R10..R03", "R03..S05", "R..R5"] {
            let error = matching(folder.path(), &[range]).unwrap_err();
            assert!(
                matches!(error, TrainerError::BadRange { .. }),
                "{range}: {error}"
            );
        }
    }
}
