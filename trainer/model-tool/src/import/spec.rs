//! The specification of an import: what a state_dict does not say of a model.

use crate::error::ToolError;
use artifact::{CodeFormat, Description, Mode, MontageFile, Padding};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use trainer::card::{self, Shape};
use trainer::error::TrainerError;

/// A specification file; an unknown field is an error.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Spec {
    /// Path of the montage file, relative to the specification.
    pub(super) montage: String,
    /// Layers of the network.
    pub(super) mode: Mode,
    /// Standard deviation of the training data, uV; the network's input is in units of it.
    pub(super) sd_uv: f64,
    /// Number of numbers in a code.
    #[serde(default = "paper_numbers")]
    pub(super) numbers: usize,
    /// Number of time steps in a window.
    #[serde(default = "paper_steps")]
    pub(super) steps: usize,
    /// Time steps from the start of one window to the start of the next.
    #[serde(default = "paper_hop")]
    pub(super) hop: usize,
    /// Zero padding of both convolutions.
    #[serde(default = "paper_padding")]
    pub(super) padding: Padding,
    /// Steps, rows and columns of the max-pool.
    #[serde(default = "paper_pool")]
    pub(super) pool: [usize; 3],
    /// Integer format of the codes.
    #[serde(default = "default_format")]
    pub(super) code_format: CodeFormat,
    /// Mains frequency of the training data, Hz.
    pub(super) mains_hz: u32,
    /// Origin and licence of the training data.
    #[serde(default)]
    pub(super) dataset: String,
    /// References to cite when the model is used.
    #[serde(default)]
    pub(super) citation: String,
    /// Labels of electrodes that were interpolated in training.
    #[serde(default)]
    pub(super) interpolated: Vec<String>,
    /// Names in the file, by the names of this project: of tensors, or of layers with all their tensors.
    #[serde(default)]
    pub(super) names: BTreeMap<String, String>,
}

fn paper_numbers() -> usize {
    128
}

fn paper_steps() -> usize {
    16
}

fn paper_hop() -> usize {
    8
}

fn paper_padding() -> Padding {
    Padding::None
}

fn paper_pool() -> [usize; 3] {
    [2, 2, 2]
}

fn default_format() -> CodeFormat {
    CodeFormat::Int8Exponent
}

impl Spec {
    /// Reads a specification.
    ///
    /// # Errors
    /// If the file cannot be read or is no specification.
    pub(super) fn read(path: &Path) -> Result<Self, ToolError> {
        let text = std::fs::read_to_string(path).map_err(|source| ToolError::File {
            path: path.to_owned(),
            source,
        })?;
        toml::from_str(&text).map_err(|source| ToolError::Spec {
            path: path.to_owned(),
            source: Box::new(source),
        })
    }

    /// Returns the description of the model. `path` is that of the specification.
    ///
    /// # Errors
    /// If the montage cannot be used, or no model can have this shape.
    pub(super) fn description(&self, path: &Path) -> Result<Description, ToolError> {
        let described = || -> Result<Description, TrainerError> {
            let folder = path.parent().unwrap_or(Path::new("."));
            let montage = MontageFile::read(&folder.join(&self.montage))?;
            let shape = Shape {
                mode: self.mode,
                numbers: self.numbers,
                steps: self.steps,
                hop: self.hop,
                padding: self.padding,
                format: self.code_format,
            };
            let mut description = card::checked_description(&montage, shape)?;
            description.network.pool = self.pool;
            description.input.sd_uv = self.sd_uv;
            self.fill_card(&mut description);
            artifact::check_description(&description).map_err(TrainerError::Shape)?;
            Ok(description)
        };
        described().map_err(|source| ToolError::Shape {
            path: path.to_owned(),
            source: Box::new(source),
        })
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

    /// Returns the name in the file of a tensor of this project: that of the longest entry of `names` that is the
    /// tensor or its layer; its own name if there is none.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(names: &str) -> Spec {
        let text = format!(
            "montage = \"m.toml\"\nmode = \"shortcut\"\nsd_uv = 40.0\nmains_hz = 50\n[names]\n{names}"
        );
        toml::from_str(&text).expect("a specification")
    }

    #[test]
    fn names_map_tensors_and_layers_and_the_longest_entry_wins() {
        let spec = spec(
            "\"encoder.conv1\" = \"encoder.0\"\n\"encoder.conv1.bias\" = \"b\"\n\"encoder.conv\" = \"x\"",
        );
        for (ours, theirs) in [
            ("encoder.conv1.weight", "encoder.0.weight"),
            ("encoder.conv1.bias", "b"),
            ("encoder.conv2.weight", "encoder.conv2.weight"),
        ] {
            assert_eq!(spec.name_in_file(ours), theirs);
        }
    }

    #[test]
    fn a_misspelt_field_is_named() {
        let text = "montage = \"m.toml\"\nmode = \"pca\"\nsd = 40.0\nmains_hz = 50";
        let error = toml::from_str::<Spec>(text).expect_err("no field `sd`");
        assert!(error.to_string().contains("unknown field `sd`"), "{error}");
    }
}
