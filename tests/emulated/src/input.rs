//! Samples for the emulated converter, and the file from which it reads them.

use std::env;
use std::path::{Path, PathBuf};

use host_sim::synthetic::{Generator, SyntheticSpec};
use model::{ADC_RATE_HZ, CHANNELS, HOP, STEP_RATE_HZ, STEPS};
use pipeline::Sample;
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc};

/// Name of the file in the image's folder that holds the samples: 32-bit ADC counts, little endian,
/// one sample after the other.
pub const FILE: &str = "samples.i32";

/// Recording of real EEG, in the folder that `CORTICODE_DATA` names: 125 s, not used in training.
const REAL: &str = "eegmmidb_S001/S001R11.edf";

/// Samples for a scenario, and the names of their sources.
#[derive(Debug)]
pub struct Input {
    /// Samples of all sources, one source after the other.
    pub samples: Vec<Sample>,
    /// Names of the sources that the samples come from.
    pub names: Vec<&'static str>,
    /// Name of each source that is not available on this machine, and the reason.
    pub skipped: Vec<String>,
}

impl Input {
    /// Returns samples for as many codes as `CORTICODE_CODES` asks for, or for 500 codes if it is
    /// not set.
    ///
    /// # Panics
    /// When the variable is not a number from 500 to 100 000, and when [`Input::new`] panics.
    pub fn from_environment() -> Self {
        let codes = env::var("CORTICODE_CODES").map_or(Ok(500), |codes| codes.parse());
        let codes = codes.expect("CORTICODE_CODES is a number");
        assert!(
            (500..=100_000).contains(&codes),
            "CORTICODE_CODES is {codes}; 500 to 100 000 are possible"
        );
        Self::new(codes)
    }

    /// Returns samples for `codes` codes, the same in every run: synthetic EEG in which some
    /// channels are at the rail, then a real recording for up to half of the samples. Without
    /// `CORTICODE_DATA`, all samples are synthetic.
    ///
    /// # Panics
    /// When `CORTICODE_DATA` is set and the recording cannot be read.
    pub fn new(codes: usize) -> Self {
        let steps = STEPS + HOP * codes.saturating_sub(1);
        let total = (steps * usize::from(ADC_RATE_HZ)).div_ceil(usize::from(STEP_RATE_HZ));
        let (mut names, mut skipped) = (vec!["synthetic EEG"], Vec::new());
        let folder = env::var_os("CORTICODE_DATA").filter(|folder| !folder.is_empty());
        let real = if let Some(folder) = folder {
            names.push("real EEG");
            recorded(&PathBuf::from(folder).join(REAL), total / 2)
        } else {
            let why = "CORTICODE_DATA is not set; it names the folder that has";
            skipped.push(format!("real EEG as input: {why} {REAL}"));
            Vec::new()
        };
        let mut spec = SyntheticSpec::new(7, model::LABELS.split(' '));
        spec.rails = true;
        let synthetic = Generator::new(&spec).expect("the model's electrodes have positions");
        let counts = synthetic.take(total - real.len()).chain(real);
        Self { samples: counts.map(|counts| Sample { counts }).collect(), names, skipped }
    }

    /// Returns the samples of the first `seconds` seconds, or all samples of a shorter input.
    pub fn first_seconds(&self, seconds: usize) -> &[Sample] {
        let count = seconds * usize::from(ADC_RATE_HZ);
        &self.samples[..count.min(self.samples.len())]
    }
}

/// Returns the first `count` samples of a recording, or all its samples if it is shorter, in the
/// model's montage and at the model's rate.
fn recorded(path: &Path, count: usize) -> Vec<[i32; CHANNELS]> {
    let recording = Recording::open(path);
    let recording = recording.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
    let map = MontageMap::new(&recording.labels(), &electrodes, Missing::Interpolate)
        .expect("the recording has the model's electrodes, or their neighbours");
    let adc = VirtualAdc::new(recording, &map, AdcSpec::ads1299(ADC_RATE_HZ.into()))
        .expect("a rate that can be resampled");
    let counts: Result<_, _> = adc.take(count).collect();
    counts.expect("the recording is whole")
}

/// Returns samples as the bytes of the file [`FILE`].
pub fn to_bytes(samples: &[Sample]) -> Vec<u8> {
    let counts = samples.iter().flat_map(|sample| sample.counts);
    counts.flat_map(i32::to_le_bytes).collect()
}
