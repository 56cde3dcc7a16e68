//! What the emulated converter reads.

use std::path::PathBuf;
use std::time::Duration;

use host_sim::synthetic::{Generator, SyntheticSpec};
use model::{ADC_RATE_HZ, HOP, STEP_RATE_HZ, STEPS};
use pipeline::Sample;

use crate::benchmark::inputs::{recorded, unusable};
use crate::failure::Failure;

/// The file in QEMU's folder that the image reads.
pub(super) const FILE: &str = "samples.i32";

/// Real EEG below the folder that `CORTICODE_DATA` names: 125 s, held out of the training.
const REAL: &str = "eegmmidb_S001/S001R11.edf";

/// Samples, and where they come from.
#[derive(Debug)]
pub(super) struct Input {
    /// One stream.
    pub(super) samples: Vec<Sample>,
    /// Its parts.
    pub(super) names: Vec<&'static str>,
    /// What could not be had.
    pub(super) skipped: Vec<String>,
}

impl Input {
    /// Samples for so many codes: synthetic EEG with channels at the rail, and behind it, for half of
    /// the codes if it is long enough, a real recording. The same on every run.
    ///
    /// # Errors
    /// The real recording is announced and cannot be read.
    pub(super) fn make(codes: usize) -> Result<Self, Failure> {
        let steps = STEPS + HOP * codes.saturating_sub(1);
        let total = (steps * usize::from(ADC_RATE_HZ)).div_ceil(usize::from(STEP_RATE_HZ));
        let mut input = Self {
            samples: Vec::new(),
            names: vec!["synthetic EEG"],
            skipped: Vec::new(),
        };
        let mut real = Vec::new();
        if let Some(folder) = std::env::var_os("CORTICODE_DATA").filter(|path| !path.is_empty()) {
            real = recorded(&PathBuf::from(folder).join(REAL), total / 2)?;
            input.names.push("real EEG");
        } else {
            let why = "real EEG as input: CORTICODE_DATA is not set; it names the folder that has";
            input.skipped.push(format!("{why} {REAL}"));
        }
        let spec = SyntheticSpec {
            rails: true,
            ..SyntheticSpec::new(7, model::LABELS.split(' '))
        };
        let synthetic = Generator::new(&spec).map_err(unusable)?;
        let counts = synthetic.take(total - real.len()).chain(real);
        input.samples = counts.map(|counts| Sample { counts }).collect();
        Ok(input)
    }

    /// As the image reads them.
    pub(super) fn bytes(&self) -> Vec<u8> {
        self.bytes_of_first(self.samples.len())
    }

    /// So many of them at most, as the image reads them.
    pub(super) fn bytes_of_first(&self, samples: usize) -> Vec<u8> {
        bytes_of(&self.samples[..samples.min(self.samples.len())])
    }

    /// How long they last.
    pub(super) fn duration(&self) -> Duration {
        Duration::from_secs((self.samples.len() / usize::from(ADC_RATE_HZ)) as u64)
    }
}

/// As the image reads them.
pub(super) fn bytes_of(samples: &[Sample]) -> Vec<u8> {
    let counts = samples.iter().flat_map(|sample| sample.counts);
    counts.flat_map(i32::to_le_bytes).collect()
}

#[cfg(test)]
mod tests {
    use pipeline::{Mains, Pipeline};

    use super::*;

    #[test]
    fn an_input_gives_as_many_codes_as_were_asked_for_and_no_two_alike() {
        let input = Input::make(40).expect("an input");
        let mut pipeline = Pipeline::new(Mains::default());
        let codes: Vec<_> = input
            .samples
            .iter()
            .filter_map(|sample| pipeline.encode_sample(sample))
            .collect();
        assert_eq!(codes.len(), 40);
        assert!(
            codes
                .windows(2)
                .all(|pair| pair[0].values != pair[1].values)
        );
        assert_eq!(input.bytes().len(), input.samples.len() * 64 * 4);
    }
}
