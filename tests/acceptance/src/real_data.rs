//! Real EEG, from the folder that `CORTICODE_DATA` names; the files are not part of the project.

use std::path::PathBuf;

use emulator::skip::skipped;
use pipeline::Sample;
use recordings::{AdcSpec, Missing, MontageMap, Recording, RecordingError, VirtualAdc};

/// GDF file: 61 electrodes at 512 Hz, int16, 30 s.
pub const GDF_I16: &str = "derived/s001r04_61ch_512hz_i16.gdf";
/// GDF file: the signals of [`GDF_I16`] as float32, not rounded.
pub const GDF_F32: &str = "derived/s001r04_61ch_512hz_f32.gdf";
/// numpy archive: windows of [`GDF_F32`] after filtering by scipy, with scipy's coefficients.
pub const SCIPY_WINDOWS: &str = "derived/ref_windows_128hz.npz";
/// EDF file: 64 electrodes at 160 Hz, 125 s; not used for training.
pub const EDF_R11: &str = "eegmmidb_S001/S001R11.edf";
/// EDF file: another recording with the format and the length of [`EDF_R11`]; not used for training
/// either.
pub const EDF_R12: &str = "eegmmidb_S001/S001R12.edf";

/// A recording cannot be converted to samples.
#[derive(Debug, thiserror::Error)]
pub enum SamplesError {
    /// The file cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// An electrode is missing and cannot be interpolated.
    #[error(transparent)]
    Montage(#[from] recordings::MontageMapError),
}

/// Returns the path of a file under `CORTICODE_DATA`. Without this variable, reports `test` as
/// skipped and returns `None`.
///
/// # Panics
/// When the variable is set and the file does not exist: a wrong path must not look like a skip.
pub fn path(test: &str, file: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("CORTICODE_DATA").filter(|folder| !folder.is_empty())
    else {
        skipped(
            test,
            format!("CORTICODE_DATA is not set; it names the folder that has {file}"),
        );
        return None;
    };
    let path = PathBuf::from(folder).join(file);
    assert!(
        path.exists(),
        "CORTICODE_DATA is set, but {} does not exist",
        path.display()
    );
    Some(path)
}

/// Returns the samples of a recording as the virtual ADC delivers them, at 512 Hz, with the
/// channels in the order of `electrodes`.
///
/// # Errors
/// The file cannot be read, or lacks electrodes that cannot be interpolated.
pub fn samples(
    path: &std::path::Path,
    electrodes: &[&str],
) -> Result<impl Iterator<Item = Result<Sample, RecordingError>>, SamplesError> {
    let recording = Recording::open(path)?;
    let map = MontageMap::new(&recording.labels(), electrodes, Missing::Interpolate)?;
    let adc = VirtualAdc::new(recording, &map, AdcSpec::ads1299(512))?;
    Ok(adc.map(|counts| counts.map(|counts| Sample { counts })))
}

/// Returns the labels of the electrodes that a recording lacks, in the order of `electrodes`.
///
/// # Errors
/// As [`samples`].
pub fn interpolated(
    path: &std::path::Path,
    electrodes: &[&str],
) -> Result<Vec<String>, SamplesError> {
    let recording = Recording::open(path)?;
    let map = MontageMap::new(&recording.labels(), electrodes, Missing::Interpolate)?;
    Ok(map.interpolated().into_iter().map(str::to_owned).collect())
}
