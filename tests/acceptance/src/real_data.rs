//! Real EEG from the folder that `CORTICODE_DATA` names; its files are not part of the project.

use std::path::{Path, PathBuf};

use emulator::skip::skipped;
use pipeline::Sample;
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc};

/// GDF file with 30 s of 61 electrodes at 512 Hz, as int16.
pub const GDF_I16: &str = "derived/s001r04_61ch_512hz_i16.gdf";
/// GDF file with the signals of [`GDF_I16`] as float32, before rounding to integers.
pub const GDF_F32: &str = "derived/s001r04_61ch_512hz_f32.gdf";
/// numpy archive with windows of [`GDF_F32`] filtered by scipy, and with scipy's coefficients.
pub const SCIPY_WINDOWS: &str = "derived/ref_windows_128hz.npz";
/// EDF file with 125 s of 64 electrodes at 160 Hz; it was not used to train the model.
pub const EDF_R11: &str = "eegmmidb_S001/S001R11.edf";
/// EDF file with another recording of the same length and format as [`EDF_R11`], also not used for
/// training.
pub const EDF_R12: &str = "eegmmidb_S001/S001R12.edf";

/// Returns the path of `file` in the folder `CORTICODE_DATA`. Without this variable, reports `test`
/// as skipped and returns `None`.
///
/// # Panics
/// When the variable is set and the file does not exist: a wrong path must not look like a skip.
pub fn path(test: &str, file: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("CORTICODE_DATA").filter(|folder| !folder.is_empty())
    else {
        skipped(test, format!("CORTICODE_DATA is not set; it names the folder that has {file}"));
        return None;
    };
    let path = PathBuf::from(folder).join(file);
    assert!(path.exists(), "CORTICODE_DATA is set, but {} does not exist", path.display());
    Some(path)
}

/// Returns the samples of a recording at 512 Hz as the virtual ADC delivers them, with the channels
/// in the order of `electrodes`.
///
/// # Panics
/// When the file cannot be read, or lacks electrodes that cannot be interpolated.
pub fn samples(path: &Path, electrodes: &[&str]) -> impl Iterator<Item = Sample> + use<> {
    let recording = Recording::open(path).expect("a recording");
    let map = MontageMap::new(&recording.labels(), electrodes, Missing::Interpolate);
    let map = map.expect("electrodes that can be interpolated");
    let adc = VirtualAdc::new(recording, &map, AdcSpec::ads1299(512)).expect("samples");
    adc.map(|counts| Sample { counts: counts.expect("a whole recording") })
}

/// Returns the labels of those `electrodes` that the recording lacks, which are interpolated.
///
/// # Panics
/// As [`samples`].
pub fn interpolated(path: &Path, electrodes: &[&str]) -> Vec<String> {
    let recording = Recording::open(path).expect("a recording");
    let map = MontageMap::new(&recording.labels(), electrodes, Missing::Interpolate);
    let map = map.expect("electrodes that can be interpolated");
    map.interpolated().into_iter().map(str::to_owned).collect()
}
