//! Compares a recording with a montage: which electrodes it has, and which it lacks.

use crate::error::TrainerError;
use crate::selection::file_name;
use artifact::MontageFile;
use recordings::montage_map::Origin;
use recordings::{Missing, MontageMap, Recording};
use std::fmt;
use std::path::Path;

/// How a recording fits a montage. `Display` prints the electrodes with their labels in the recording,
/// those that would be interpolated, and the signals that no electrode uses.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingCheck {
    name: String,
    labels: Vec<String>,
    map: MontageMap,
}

impl RecordingCheck {
    /// Reads the labels of a recording and compares them with a montage.
    ///
    /// # Errors
    /// If the recording cannot be read or has none of the electrodes.
    pub fn read(path: &Path, montage: &MontageFile) -> Result<Self, TrainerError> {
        let name = file_name(path);
        let recording = Recording::open(path).map_err(|source| TrainerError::Recording {
            name: name.clone(),
            source,
        })?;
        let labels = recording.labels();
        let labels: Vec<String> = labels.iter().map(|label| (*label).to_owned()).collect();
        Self::new(name, labels, montage)
    }

    /// Compares the labels of a recording with a montage.
    ///
    /// # Errors
    /// If there is none of the montage's electrodes.
    pub fn new(
        name: String,
        labels: Vec<String>,
        montage: &MontageFile,
    ) -> Result<Self, TrainerError> {
        let electrodes = montage.montage().electrodes;
        match MontageMap::new(&labels, &electrodes, Missing::Interpolate) {
            Ok(map) => Ok(Self { name, labels, map }),
            Err(source) => Err(TrainerError::Montage { name, source }),
        }
    }
}

impl fmt::Display for RecordingCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let origins = self.map.electrodes().iter().zip(self.map.origins());
        let recorded: Vec<String> = origins
            .filter_map(|(electrode, origin)| match origin {
                Origin::Real(signal) => {
                    let label = self.labels[*signal].trim();
                    Some(if label == electrode {
                        label.to_owned()
                    } else {
                        format!("{electrode} (as {label})")
                    })
                }
                Origin::Interpolated(_) | Origin::Zero => None,
            })
            .collect();
        let missing = self.map.interpolated();
        let used = |signal: usize| {
            let origins = self.map.origins().iter();
            origins
                .into_iter()
                .any(|origin| *origin == Origin::Real(signal))
        };
        let unused = self
            .labels
            .iter()
            .enumerate()
            .filter(|(signal, _)| !used(*signal));
        let unused: Vec<&str> = unused.map(|(_, label)| label.trim()).collect();
        writeln!(f, "{}:", self.name)?;
        for (what, labels) in [
            ("recorded", recorded.iter().map(String::as_str).collect()),
            ("missing, would be interpolated", missing),
            ("signals that are no electrode of the montage", unused),
        ] {
            let labels: Vec<&str> = labels;
            let text = format!("  {what}: {} {}", labels.len(), labels.join(" "));
            writeln!(f, "{}", text.trim_end())?;
        }
        for warning in self.map.warnings() {
            writeln!(f, "  note: {warning}")?;
        }
        Ok(())
    }
}
