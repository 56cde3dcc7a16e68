//! The built-in model, and EEG with its electrodes, for the other modules.

use std::path::Path;

use acceptance::real_data;
use artifact::Artifact;
use host_sim::synthetic::{Generator, SyntheticSpec};
use model::LABELS;
use pipeline::{Acquisition, Mains, Sample, Step};

pub(crate) fn artifact() -> Artifact {
    Artifact::from_files(model::artifact_files::FILES).expect("the built-in model")
}

/// Returns host-sim's synthetic EEG.
pub(crate) fn synthetic(seed: u64) -> impl Iterator<Item = Sample> {
    let spec = SyntheticSpec::new(seed, LABELS.split(' '));
    let generator = Generator::new(&spec).expect("the model's electrodes");
    generator.map(|counts| Sample { counts })
}

/// Returns the samples of a recording, with the built-in model's electrodes as channels.
pub(crate) fn recorded(path: &Path) -> impl Iterator<Item = Sample> {
    real_data::samples(path, &LABELS.split(' ').collect::<Vec<_>>())
}

/// Returns the time steps, filtered and quantised, that the acquisition computes from `samples`.
pub(crate) fn steps(
    mains: Mains,
    samples: impl Iterator<Item = Sample>,
) -> impl Iterator<Item = Step> {
    let mut acquisition = Acquisition::new(mains);
    samples.filter_map(move |sample| acquisition.process_sample(&sample))
}
