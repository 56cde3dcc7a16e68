//! Files of formats that are not read, recognised so that the error says how to export them.

use std::path::Path;

use crate::error::RecordingError;

const EEGLAB: &str = "in EEGLAB choose File, Export, Data to EDF/BDF/GDF file; or in MNE-Python run \
                      mne.io.read_raw_eeglab('FILE.set').export('FILE.edf')";
const BRAIN_VISION: &str =
    "in MNE-Python run mne.io.read_raw_brainvision('FILE.vhdr').export('FILE.edf')";

/// Returns the error with which a file cannot be opened. An unknown format becomes
/// [`RecordingError::OtherFormat`] if the first bytes or the name of the file are those of a format that
/// other programs export.
pub(crate) fn explain(path: &Path, error: RecordingError) -> RecordingError {
    let RecordingError::UnknownFormat { found } = &error else {
        return error;
    };
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    // `found` has the first eight bytes, those that are not printable escaped.
    let starts_with = |start: &str| found.starts_with(start);
    let (what, how) = match &*extension.to_ascii_lowercase() {
        _ if starts_with("Brain Vi") || starts_with("BrainVis") => {
            ("a text file of a BrainVision recording", BRAIN_VISION)
        }
        "vhdr" | "vmrk" | "eeg" => ("a file of a BrainVision recording", BRAIN_VISION),
        "set" => ("an EEGLAB data set", EEGLAB),
        "fdt" => ("the data file of an EEGLAB data set", EEGLAB),
        _ if starts_with("MATLAB 5") => ("a MATLAB file, such as an EEGLAB data set", EEGLAB),
        _ => return error,
    };
    RecordingError::OtherFormat { what, how }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(name: &str, found: &str) -> String {
        let found = found.to_owned();
        explain(Path::new(name), RecordingError::UnknownFormat { found }).to_string()
    }

    #[test]
    fn formats_that_others_export_are_named_with_the_way_to_export_them() {
        for (name, found, format) in [
            ("a.set", "MATLAB 5", "EEGLAB"),
            ("a.set", "\\x89HDF\\r\\n\\x1a\\n", "EEGLAB"),
            ("a.fdt", "\\x01\\x02", "EEGLAB"),
            ("a.mat", "MATLAB 5", "EEGLAB"),
            ("a.VHDR", "Brain Vi", "BrainVision"),
            ("a.txt", "BrainVis", "BrainVision"),
            ("a.vmrk", "Brain Vi", "BrainVision"),
            ("a.eeg", "\\x01\\x02", "BrainVision"),
        ] {
            let message = message(name, found);
            assert!(message.contains(format), "{name}: {message}");
            assert!(message.contains(".export('FILE.edf')"), "{name}: {message}");
        }
        assert!(message("a.csv", "time,Cz,").contains("not a recording"));
    }
}
