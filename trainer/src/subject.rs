//! Subjects of recordings, derived from file names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A subject with its recordings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Subject {
    pub(crate) name: String,
    pub(crate) recordings: Vec<PathBuf>,
}

/// Groups recordings by subject. If `name` is given, all recordings belong to the subject of this
/// name. Otherwise a subject's name is what remains of the file name without its extension, the
/// number of the run at its end and the word before this number: `S001R03.edf` and `S001R04.edf`
/// belong to `S001`, `motorexecution_subject2_run1.gdf` belongs to `motorexecution_subject2`. A
/// file without a number is a subject of its own.
pub(crate) fn group(recordings: &[PathBuf], name: Option<&str>) -> Vec<Subject> {
    let mut subjects: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for recording in recordings {
        let subject = name.map_or_else(|| subject_of(recording), str::to_owned);
        subjects.entry(subject).or_default().push(recording.clone());
    }
    let subjects = subjects.into_iter().map(|(name, mut recordings)| {
        recordings.sort();
        recordings.dedup();
        Subject { name, recordings }
    });
    subjects.collect()
}

/// Returns the name of the subject of a file, by the rules of [`group`].
pub(crate) fn subject_of(recording: &Path) -> String {
    let stem = recording.file_stem().unwrap_or_default();
    let stem = stem.to_string_lossy().into_owned();
    let without_number = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    if without_number.len() == stem.len() {
        return stem;
    }
    let without_word = without_number.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let subject = without_word.trim_end_matches(['_', '-', ' ']);
    // A file name of only a word and a number, such as run3, names no subject.
    if subject.is_empty() { "all".to_owned() } else { subject.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_grouped_by_what_precedes_their_number() {
        for (file, subject) in [
            ("data/S001R03.edf", "S001"),
            ("data/motorexecution_subject2_run10.gdf", "motorexecution_subject2"),
            ("A01-3.gdf", "A01"),
            ("run7.edf", "all"),
            ("test.bdf", "test"),
        ] {
            assert_eq!(subject_of(Path::new(file)), subject, "{file}");
        }
    }

    #[test]
    fn a_name_unites_all_recordings_sorted_and_once() {
        let files = ["b2.edf", "a1.edf", "b2.edf"].map(PathBuf::from);
        let subjects = group(&files, Some("me"));
        assert_eq!(subjects.len(), 1);
        assert_eq!(subjects[0].recordings, ["a1.edf", "b2.edf"].map(PathBuf::from));
        assert_eq!(group(&files, None)[0].name, "all");
    }
}
