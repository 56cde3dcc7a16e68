//! Checks a model: its files, its integers, its golden codes and, on recordings, its error.

use crate::error::ToolError;
use artifact::{Artifact, Golden};
use model_gen::{DeviceModel, IntegerModel};
use serde_json::{Value as Json, json};
use std::fmt;
use std::path::{Path, PathBuf};
use trainer::comparison::{self, Comparison};
use trainer::progress::ProgressObserver;

/// Recordings to measure the error on.
#[derive(Clone, Debug)]
pub struct Recordings {
    /// Folder in which names are searched.
    pub data: PathBuf,
    /// Files, folders, patterns or ends of names; empty for those of the training card.
    pub names: Vec<String>,
    /// Mains frequency, Hz; `None` for that of the training.
    pub mains_hz: Option<u32>,
}

/// What a check found.
#[derive(Clone, Debug)]
pub struct Checked {
    /// Id of the model.
    pub model: String,
    /// Bits of an integer code.
    pub bits_per_window: usize,
    /// Number of electrodes that were recorded in training.
    pub real_electrodes: usize,
    /// Number of golden windows.
    pub golden: usize,
    /// Golden windows whose stored code is not that of the integer encoder.
    pub wrong: Vec<usize>,
    /// Error on recordings.
    pub comparison: Option<Comparison>,
}

/// Reads a model, turns it into integers, which proves that no sum overflows, compares its golden codes, and measures
/// its error on recordings.
///
/// # Errors
/// If a file cannot be read, the model cannot be turned into integers, or a recording cannot be used. Golden codes
/// that differ are no error: [`Checked::wrong`] has them.
pub fn check(
    folder: &Path,
    recordings: Option<&Recordings>,
    observer: &mut impl ProgressObserver,
) -> Result<Checked, ToolError> {
    let unusable = |source| ToolError::Artifact {
        folder: folder.to_owned(),
        source: Box::new(source),
    };
    let model = Artifact::read(folder).map_err(unusable)?;
    let golden = Golden::read(folder).map_err(unusable)?;
    let integers = DeviceModel::new(&model)
        .map_err(|source| ToolError::Integers {
            folder: folder.to_owned(),
            source: Box::new(source),
        })?
        .integers;
    let comparison = match recordings {
        None => None,
        Some(Recordings {
            data,
            names,
            mains_hz,
        }) => Some(
            comparison::compare(folder, data, names, *mains_hz, observer)
                .map_err(|source| ToolError::Recordings(Box::new(source)))?,
        ),
    };
    let code = &model.description.code;
    Ok(Checked {
        model: model.id.to_string(),
        bits_per_window: code.format.bits(code.numbers),
        real_electrodes: model.description.training.real_electrodes,
        golden: golden.windows.len(),
        wrong: wrong_windows(&integers, &golden),
        comparison,
    })
}

/// Returns the golden windows whose code differs; all, if their shape or format is not the model's.
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
    /// Returns whether all golden codes are right.
    pub fn is_good(&self) -> bool {
        self.wrong.is_empty() && self.golden > 0
    }

    /// Returns what was found as a JSON object. On recordings it has the keys of `trainer evaluate --json`, and
    /// `real_electrodes` counts those of the recordings.
    pub fn to_json(&self) -> Json {
        let mut object = json!({
            "model": self.model,
            "bits_per_window": self.bits_per_window,
            "real_electrodes": self.real_electrodes,
            "golden_windows": self.golden,
            "golden_wrong": self.wrong,
        });
        let figures = self.comparison.as_ref().map(Comparison::to_json);
        if let (Json::Object(object), Some(Json::Object(figures))) = (&mut object, figures) {
            object.extend(figures);
        }
        object
    }
}

impl fmt::Display for Checked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "model {}: files, ranges and filters are valid",
            self.model
        )?;
        match self.wrong.as_slice() {
            [] if self.golden == 0 => {
                writeln!(f, "golden.safetensors has no window, so it checks nothing")?;
            }
            [] => writeln!(
                f,
                "{} golden codes equal the integer encoder's",
                self.golden
            )?,
            wrong => writeln!(
                f,
                "{} of {} golden codes differ from the integer encoder's, the first is that of window {}: \
                 golden.safetensors belongs to another model",
                wrong.len(),
                self.golden,
                wrong[0]
            )?,
        }
        match &self.comparison {
            Some(comparison) => write!(f, "{comparison}"),
            None => Ok(()),
        }
    }
}
