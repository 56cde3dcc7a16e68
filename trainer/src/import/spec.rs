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
    /// Path of the montage file, relative to the specification.
    pub(super) montage: String,
    /// Layers of the network.
    pub(super) mode: Mode,
    /// Standard deviation of the training data, uV; the network's input is in units of it.
    pub(super) sd_uv: f64,
    /// Number of numbers in a code.
    #[serde(default = "default::numbers")]
    pub(super) numbers: usize,
    /// Number of time steps in a window.
    #[serde(default = "default::steps")]
    pub(super) steps: usize,
    /// Time steps from the start of one window to the start of the next.
    #[serde(default = "default::hop")]
    pub(super) hop: usize,
    /// Zero padding of both convolutions.
    #[serde(default = "default::padding")]
    pub(super) padding: Padding,
    /// Steps, rows and columns of the max-pool.
    #[serde(default = "default::pool")]
    pub(super) pool: [usize; 3],
    /// Integer format of the codes.
    #[serde(default = "default::code_format")]
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
    /// Names in the file, by the names of this project: of tensors, or of layers with all their
    /// tensors.
    #[serde(default)]
    pub(super) names: BTreeMap<String, String>,
}

/// The paper's dimensions, and the code format with the least loss for its bits.
mod default {
    use artifact::{CodeFormat, Padding};

    macro_rules! defaults {
        ($($field:ident: $type:ty = $value:expr;)*) => {
            $(pub(super) fn $field() -> $type { $value })*
        };
    }
    defaults! {
        numbers: usize = 128;
        steps: usize = 16;
        hop: usize = 8;
        padding: Padding = Padding::None;
        pool: [usize; 3] = [2, 2, 2];
        code_format: CodeFormat = CodeFormat::Int8Exponent;
    }
}

impl Spec {
    /// Reads a specification.
    ///
    /// # Errors
    /// If the file cannot be read or is no specification.
    pub(super) fn read(path: &Path) -> Result<Self, TrainerError> {
        let text = std::fs::read_to_string(path).map_err(TrainerError::file(path))?;
        toml::from_str(&text)
            .map_err(|source| TrainerError::Spec(path.to_owned(), Box::new(source)))
    }

    /// Returns the description of the model. `path` is that of the specification.
    ///
    /// # Errors
    /// If the montage cannot be used, or no model can have this shape.
    pub(super) fn description(&self, path: &Path) -> Result<Description, TrainerError> {
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

    /// Returns the name in the file of a tensor of this project: that of the longest entry of
    /// `names` that is the tensor or its layer; its own name if there is none.
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

    #[test]
    fn names_map_tensors_and_layers_and_the_longest_entry_wins() {
        let text = r#"
            montage = "m.toml"
            mode = "shortcut"
            sd_uv = 40.0
            mains_hz = 50
            [names]
            "encoder.conv1" = "encoder.0"
            "encoder.conv1.bias" = "b"
            "encoder.conv" = "x"
        "#;
        let spec: Spec = toml::from_str(text).expect("a specification");
        for (ours, theirs) in [
            ("encoder.conv1.weight", "encoder.0.weight"),
            ("encoder.conv1.bias", "b"),
            ("encoder.conv2.weight", "encoder.conv2.weight"),
        ] {
            assert_eq!(spec.name_in_file(ours), theirs);
        }
    }
}
