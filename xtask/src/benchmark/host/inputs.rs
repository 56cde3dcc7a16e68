//! What the contenders encode: synthetic EEG.

use std::fs;
use std::path::{Path, PathBuf};

use artifact::Artifact;
use host_sim::synthetic::{Generator, SyntheticSpec};
use model::{CELLS, CHANNELS, GRID_CELL, HOP, INPUT_SCALE_UV, STEPS};
use pipeline::{Acquisition, Mains, Plane, Sample};

use super::super::inputs::unusable;
use super::super::{cannot_write, make_folder};
use crate::command::root;
use crate::failure::Failure;

/// Windows, and as many in a batch.
const WINDOWS: usize = 256;

/// The inputs, once for each contender.
#[derive(Debug)]
pub(crate) struct Inputs {
    /// The model.
    pub(crate) artifact: Artifact,
    counts: Vec<[i32; CHANNELS]>,
    /// Its windows as the network takes them in floats, step by step, cell by cell.
    pub(crate) windows: Vec<[f32; STEPS * CELLS]>,
}

impl Inputs {
    /// The same on every run.
    ///
    /// # Errors
    /// The artifact cannot be read, or there is no synthetic EEG.
    pub(crate) fn make() -> Result<Self, Failure> {
        let artifact = Artifact::read(&folder_of_the_artifact()).map_err(unusable)?;
        let spec = SyntheticSpec::new(3, model::LABELS.split(' '));
        let mut generator = Generator::new(&spec).map_err(unusable)?;
        let mut acquisition = Acquisition::new(Mains::Hz50);
        let (mut counts, mut planes) = (Vec::new(), Vec::<Plane>::new());
        let steps = STEPS + (WINDOWS - 1) * HOP;
        for sample in generator.by_ref() {
            counts.push(sample);
            planes.extend(
                acquisition
                    .process_sample(&Sample { counts: sample })
                    .map(|step| step.plane),
            );
            if planes.len() == steps {
                break;
            }
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the network computes in f32"
        )]
        let scale = INPUT_SCALE_UV / artifact.description.input.sd_uv as f32;
        let windows = planes.windows(STEPS).step_by(HOP);
        let windows = windows.map(|window| {
            let cells = window.as_flattened();
            std::array::from_fn(|cell| f32::from(cells[cell]) * scale)
        });
        Ok(Self {
            windows: windows.collect(),
            artifact,
            counts,
        })
    }

    /// Writes them where the contenders run.
    ///
    /// # Errors
    /// The folder is not writable.
    pub(crate) fn write(&self, folder: &Path) -> Result<(), Failure> {
        make_folder(folder)?;
        let counts = self.counts.as_flattened().iter();
        let cells = self.windows.as_flattened().iter();
        for (name, bytes) in [
            (
                bench::host::COUNTS,
                counts
                    .flat_map(|count| count.to_le_bytes())
                    .collect::<Vec<u8>>(),
            ),
            (
                "windows.bin",
                cells.flat_map(|cell| cell.to_le_bytes()).collect(),
            ),
        ] {
            let path = folder.join(name);
            fs::write(&path, bytes).map_err(|error| cannot_write(&path, &error))?;
        }
        Ok(())
    }

    /// The file with the model's weights.
    pub(crate) fn weights() -> PathBuf {
        folder_of_the_artifact().join("weights.safetensors")
    }

    /// The electrodes' cells in the montage's order.
    pub(crate) fn cells() -> String {
        let cells: Vec<String> = GRID_CELL.iter().map(ToString::to_string).collect();
        cells.join(",")
    }
}

fn folder_of_the_artifact() -> PathBuf {
    root().join("model").join("artifact")
}
