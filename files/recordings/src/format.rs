//! File formats. EDF, BDF and GDF are recognised by their first eight bytes.

use std::fmt;

use crate::error::RecordingError;

/// Format, variant and version of a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Format {
    /// European Data Format: 16-bit samples.
    Edf,
    /// EDF+ with contiguous records (EDF+C).
    EdfPlusContinuous,
    /// EDF+ with possible gaps between records (EDF+D).
    EdfPlusDiscontinuous,
    /// BioSemi's 24-bit variant of EDF.
    Bdf,
    /// BDF+ with contiguous records (BDF+C).
    BdfPlusContinuous,
    /// BDF+ with possible gaps between records (BDF+D).
    BdfPlusDiscontinuous,
    /// General Data Format before version 1.90; holds the version, such as 1.25.
    Gdf1(f64),
    /// General Data Format from version 1.90; holds the version, such as 2.10.
    Gdf2(f64),
}

impl Format {
    /// Recognises EDF, BDF or a GDF version by the first eight bytes of a file. The `+` variants have
    /// the same first bytes; the parser distinguishes them by the reserved field of the header.
    ///
    /// # Errors
    /// [`RecordingError::UnknownFormat`] for all other bytes.
    pub(crate) fn detect(magic: [u8; 8]) -> Result<Self, RecordingError> {
        let unknown = || RecordingError::UnknownFormat {
            found: magic.escape_ascii().to_string(),
        };
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

    /// Returns whether the format allows gaps between records.
    pub fn is_discontinuous(self) -> bool {
        matches!(
            self,
            Self::EdfPlusDiscontinuous | Self::BdfPlusDiscontinuous
        )
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
