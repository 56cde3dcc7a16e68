//! File formats. EDF, BDF and GDF are recognised by the first eight bytes of a file. Formats that
//! cannot be read are recognised too, so that the error says how to export them.

use std::{fmt, path::Path};

use crate::error::RecordingError;

/// Format, variant and version of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Format {
    /// European Data Format: 16-bit samples.
    Edf,
    /// EDF+ whose records follow each other without gaps (EDF+C).
    EdfPlusContinuous,
    /// EDF+ that can have gaps between records (EDF+D).
    EdfPlusDiscontinuous,
    /// BioSemi's 24-bit variant of EDF.
    Bdf,
    /// BDF+ whose records follow each other without gaps (BDF+C).
    BdfPlusContinuous,
    /// BDF+ that can have gaps between records (BDF+D).
    BdfPlusDiscontinuous,
    /// General Data Format before version 1.90; holds the version, such as 1.25.
    Gdf1(f64),
    /// General Data Format from version 1.90; holds the version, such as 2.10.
    Gdf2(f64),
}

impl Format {
    /// Recognises EDF, BDF or a GDF version by the first eight bytes of a file. The `+` variants
    /// have the same first bytes; the header parser tells them apart by the reserved field.
    ///
    /// # Errors
    /// [`RecordingError::UnknownFormat`] for all other bytes.
    pub(crate) fn detect(magic: [u8; 8]) -> Result<Self, RecordingError> {
        let unknown = || RecordingError::UnknownFormat { found: magic.escape_ascii().to_string() };
        if magic[0] == b'0' && magic[1..].iter().all(|&b| b == b' ' || b == 0) {
            return Ok(Self::Edf);
        }
        if magic == *b"\xffBIOSEMI" {
            return Ok(Self::Bdf);
        }
        let version = magic
            .strip_prefix(b"GDF ")
            .and_then(|rest| std::str::from_utf8(rest).ok())
            .and_then(|rest| rest.trim_matches(['\0', ' ']).parse::<f64>().ok())
            .ok_or_else(unknown)?;
        if (1.0..1.9).contains(&version) {
            Ok(Self::Gdf1(version))
        } else if (1.9..3.0).contains(&version) {
            Ok(Self::Gdf2(version))
        } else {
            Err(unknown())
        }
    }

    /// Returns whether the format allows gaps between records (EDF+D and BDF+D).
    pub fn is_discontinuous(self) -> bool {
        matches!(self, Self::EdfPlusDiscontinuous | Self::BdfPlusDiscontinuous)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Edf => f.write_str("EDF"),
            Self::EdfPlusContinuous => f.write_str("EDF+C"),
            Self::EdfPlusDiscontinuous => f.write_str("EDF+D"),
            Self::Bdf => f.write_str("BDF"),
            Self::BdfPlusContinuous => f.write_str("BDF+C"),
            Self::BdfPlusDiscontinuous => f.write_str("BDF+D"),
            Self::Gdf1(version) | Self::Gdf2(version) => write!(f, "GDF {version:.2}"),
        }
    }
}

const EEGLAB: &str = "in EEGLAB choose File, Export, Data to EDF/BDF/GDF file; or in MNE-Python run \
                      mne.io.read_raw_eeglab('FILE.set').export('FILE.edf')";
const BRAIN_VISION: &str =
    "in MNE-Python run mne.io.read_raw_brainvision('FILE.vhdr').export('FILE.edf')";

/// Replaces the error for an unknown format by [`RecordingError::OtherFormat`], if the first bytes
/// or the name of the file belong to a format that other programs can export.
pub(crate) fn explain(path: &Path, error: RecordingError) -> RecordingError {
    let RecordingError::UnknownFormat { found } = &error else {
        return error;
    };
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    // The error's `found` holds the first eight bytes; unprintable ones are escaped.
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
