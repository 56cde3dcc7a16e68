//! The specification of an import: properties of a model that its state_dict does not contain.

use crate::card::{self, Shape};
use crate::error::TrainerError;
use artifact::{CodeFormat, Description, Mode, MontageFile, Padding};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A specification file; an unknown field is an error.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Spec {
    /// Path of the montage file, relative to the folder of the specification.
    montage: String,
    /// Layers of the network.
    mode: Mode,
    /// Standard deviation of the training data, uV; it is the unit of the network's input.
    sd_uv: f64,
    /// Number of values in a code; 128, as in the paper, if not stated.
    numbers: Option<usize>,
    /// Time steps of a window; 16, as in the paper, if not stated.
    steps: Option<usize>,
    /// Time steps from the start of one window to the start of the next; 8 if not stated.
    hop: Option<usize>,
    /// Zero padding of both convolutions; none if not stated.
    padding: Option<Padding>,
    /// Steps, rows and columns of the max-pool; 2 of each if not stated.
    pool: Option<[usize; 3]>,
    /// Integer format of the codes; if not stated, `int8-exponent`, which loses the least accuracy
    /// for its size.
    code_format: Option<CodeFormat>,
    /// Mains frequency of the training data, Hz.
    mains_hz: u32,
    /// Origin and licence of the training data.
    #[serde(default)]
    dataset: String,
    /// References to cite when the model is used.
    #[serde(default)]
    citation: String,
    /// Labels of electrodes that were interpolated in training.
    #[serde(default)]
    interpolated: Vec<String>,
    /// Maps the name of a tensor in this project, or of a layer with all its tensors, to its name
    /// in the file.
    #[serde(default)]
    pub(super) names: BTreeMap<String, String>,
}

impl Spec {
    /// Reads a specification.
    ///
    /// # Errors
    /// If the file cannot be read or is not a specification.
    pub(super) fn read(path: &Path) -> Result<Self, TrainerError> {
        let text = std::fs::read_to_string(path).map_err(TrainerError::file(path))?;
        toml::from_str(&text)
            .map_err(|source| TrainerError::Spec(path.to_owned(), Box::new(source)))
    }

    /// Returns the description of the model. `path` is the specification's path, to which the
    /// montage file's path is relative.
    ///
    /// # Errors
    /// If the montage cannot be used, or no model can have this shape.
    pub(super) fn description(&self, path: &Path) -> Result<Description, TrainerError> {
        let described = || -> Result<Description, TrainerError> {
            let folder = path.parent().unwrap_or(Path::new("."));
            let montage = MontageFile::read(&folder.join(&self.montage))?;
            let shape = Shape {
                mode: self.mode,
                numbers: self.numbers.unwrap_or(128),
                steps: self.steps.unwrap_or(16),
                hop: self.hop.unwrap_or(8),
                padding: self.padding.unwrap_or(Padding::None),
                format: self.code_format.unwrap_or(CodeFormat::Int8Exponent),
            };
            let mut description = card::checked_description(&montage, shape)?;
            description.network.pool = self.pool.unwrap_or([2, 2, 2]);
            description.input.sd_uv = self.sd_uv;
            self.fill_card(&mut description);
            artifact::check_description(&description).map_err(TrainerError::Shape)?;
            Ok(description)
        };
        described().map_err(|source| TrainerError::Described(path.to_owned(), Box::new(source)))
    }

    fn fill_card(&self, description: &mut Description) {
        let electrodes = description.montage.electrodes.len();
        let card = &mut description.training;
        card.dataset.clone_from(&self.dataset);
        card.citation.clone_from(&self.citation);
        card.interpolated.clone_from(&self.interpolated);
        card.interpolated_electrodes = self.interpolated.len();
        card.real_electrodes = electrodes.saturating_sub(self.interpolated.len());
        card.mains_hz = self.mains_hz;
        "imported".clone_into(&mut card.optimiser);
    }

    /// Returns the name that the file uses for this project's tensor `name`: determined by the
    /// longest entry of `names` that matches the tensor or its layer; `name` without such an entry.
    pub(super) fn name_in_file(&self, name: &str) -> String {
        let entry = self.names.iter().filter_map(|(ours, theirs)| {
            let rest = name.strip_prefix(ours.as_str())?;
            (rest.is_empty() || rest.starts_with('.')).then_some((ours.len(), theirs, rest))
        });
        match entry.max_by_key(|(length, ..)| *length) {
            Some((_, theirs, rest)) => format!("{theirs}{rest}"),
            None => name.to_owned(),
        }
    }
}
