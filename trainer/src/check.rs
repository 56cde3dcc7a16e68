//! Checks a model: its files, its integers and its golden codes.

use crate::error::TrainerError;
use crate::substitution::{largest_radius, radius_text};
use artifact::{Artifact, Golden};
use model_gen::{DeviceModel, IntegerModel};
use serde_json::{Value as Json, json};
use std::fmt;
use std::path::PathBuf;

/// Options of `trainer check`.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct CheckOptions {
    /// Folder of the model.
    #[arg(default_value = "signal/model/artifact")]
    folder: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Result of `trainer check` for a model, which the command prints.
#[derive(Clone, Debug)]
pub(crate) struct Checked {
    pub(crate) model: String,
    /// Number of electrodes that were recorded in training, not interpolated.
    pub(crate) real_electrodes: usize,
    /// Result for the golden codes; `None` if the model has no network.
    pub(crate) codes: Option<CheckedCodes>,
    /// Largest spectral radius of the substitution of bad electrodes; `None` if the model has no
    /// table for it.
    pub(crate) substitution_radius: Option<f64>,
}

/// Comparison of a network's golden codes with the codes of its integer encoder.
#[derive(Clone, Debug)]
pub(crate) struct CheckedCodes {
    /// Length of an integer code in bits.
    pub(crate) bits_per_window: usize,
    pub(crate) windows: usize,
    /// Indices of the golden windows whose stored code differs from the integer encoder's code.
    pub(crate) wrong: Vec<usize>,
}

/// Checks a model: reads it, converts it to integers (which proves that no sum overflows), compares
/// its golden codes, and checks that the substitution of bad electrodes converges.
///
/// # Errors
/// If a file cannot be read, the model cannot be turned into integers, or the substitution does not
/// converge. Differing golden codes are not an error: [`CheckedCodes::wrong`] lists their windows.
pub(crate) fn check(options: &CheckOptions) -> Result<Checked, TrainerError> {
    let folder = &options.folder;
    let model = Artifact::read(folder).map_err(TrainerError::no_model(folder))?;
    let has_network = model.description.mode.has_network();
    let golden = has_network.then(|| Golden::read(folder));
    let golden = golden.transpose().map_err(TrainerError::no_model(folder))?;
    let integers = DeviceModel::new(&model)?.integers;
    let table = model.substitution.as_ref();
    let radius = table.map(|table| largest_radius(table, &model.description)).transpose()?;
    let code = &model.description.code;
    let codes = golden.map(|golden| CheckedCodes {
        bits_per_window: code.format.bits(code.numbers),
        windows: golden.windows.len(),
        wrong: wrong_windows(&integers, &golden),
    });
    Ok(Checked {
        model: model.id.to_string(),
        real_electrodes: model.description.training.real_electrodes,
        codes,
        substitution_radius: radius,
    })
}

/// Returns the indices of the golden windows whose code differs from the integer encoder's code;
/// all indices if shape or format of the golden codes differs from the model's.
fn wrong_windows(integers: &IntegerModel, golden: &Golden) -> Vec<usize> {
    let dimensions = integers.geometry.dimensions;
    let all = 0..golden.windows.len();
    if golden.format != integers.code_format
        || golden.window_shape != [dimensions.steps, dimensions.cells()]
    {
        return all.collect();
    }
    all.filter(|&index| integers.encode_window(&golden.windows[index]) != golden.codes[index])
        .collect()
}

impl Checked {
    /// Returns whether there are golden codes and all are right. Always true for a model without a
    /// network.
    pub(crate) fn is_good(&self) -> bool {
        let codes = self.codes.as_ref();
        codes.is_none_or(|codes| codes.wrong.is_empty() && codes.windows > 0)
    }

    /// Returns the result as a JSON object. Without a network, the keys about codes are left out.
    pub(crate) fn to_json(&self) -> Json {
        let mut object = json!({
            "model": self.model,
            "real_electrodes": self.real_electrodes,
        });
        if let Some(radius) = self.substitution_radius {
            object["substitution_radius"] = json!(radius);
        }
        if let Some(codes) = &self.codes {
            object["bits_per_window"] = json!(codes.bits_per_window);
            object["golden_windows"] = json!(codes.windows);
            object["golden_wrong"] = json!(codes.wrong);
        }
        object
    }
}

impl fmt::Display for Checked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "model {}: files, ranges and filters are valid", self.model)?;
        match &self.codes {
            Some(codes) => write!(f, "{codes}")?,
            None => writeln!(f, "the model has no network, so it has no golden codes")?,
        }
        match self.substitution_radius {
            Some(radius) => writeln!(f, "{}", radius_text(radius)),
            None => Ok(()),
        }
    }
}

impl fmt::Display for CheckedCodes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { windows, wrong, .. } = self;
        match wrong.as_slice() {
            [] if *windows == 0 => {
                writeln!(f, "golden.safetensors has no window, so it checks nothing")
            }
            [] => writeln!(f, "{windows} golden codes equal the integer encoder's"),
            [first, ..] => writeln!(
                f,
                "{} of {windows} golden codes differ from the integer encoder's, the first is that of window {first}: \
                 golden.safetensors belongs to another model",
                wrong.len(),
            ),
        }
    }
}
