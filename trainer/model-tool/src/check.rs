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
    /// Number of electrodes that were recorded in training.
    pub real_electrodes: usize,
    /// The golden codes; `None` if the model has no network.
    pub codes: Option<CheckedCodes>,
    /// Error on recordings.
    pub comparison: Option<Comparison>,
}

/// The golden codes of a network.
#[derive(Clone, Debug)]
pub struct CheckedCodes {
    /// Bits of an integer code.
    pub bits_per_window: usize,
    /// Number of golden windows.
    pub windows: usize,
    /// Golden windows whose stored code is not that of the integer encoder.
    pub wrong: Vec<usize>,
}

/// Reads a model, turns it into integers, which proves that no sum overflows, compares its golden codes, and measures
/// its error on recordings.
///
/// # Errors
/// If a file cannot be read, the model cannot be turned into integers, or a recording cannot be used. Golden codes
/// that differ are no error: [`CheckedCodes::wrong`] has them.
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
    let golden = if model.description.mode.has_network() {
        Some(Golden::read(folder).map_err(unusable)?)
    } else {
        None
    };
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
    let codes = golden.map(|golden| CheckedCodes {
        bits_per_window: code.format.bits(code.numbers),
        windows: golden.windows.len(),
        wrong: wrong_windows(&integers, &golden),
    });
    Ok(Checked {
        model: model.id.to_string(),
        real_electrodes: model.description.training.real_electrodes,
        codes,
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
    /// Returns whether all golden codes are right, if the model has a network.
    pub fn is_good(&self) -> bool {
        let codes = self.codes.as_ref();
        codes.is_none_or(|codes| codes.wrong.is_empty() && codes.windows > 0)
    }

    /// Returns what was found as a JSON object. On recordings it has the keys of `trainer evaluate --json`, and
    /// `real_electrodes` counts those of the recordings. A model without a network has no key of its codes.
    pub fn to_json(&self) -> Json {
        let mut object = json!({
            "model": self.model,
            "real_electrodes": self.real_electrodes,
        });
        let codes = self.codes.as_ref().map(|codes| {
            json!({
                "bits_per_window": codes.bits_per_window,
                "golden_windows": codes.windows,
                "golden_wrong": codes.wrong,
            })
        });
        let figures = self.comparison.as_ref().map(Comparison::to_json);
        for part in [codes, figures].into_iter().flatten() {
            if let (Json::Object(object), Json::Object(part)) = (&mut object, part) {
                object.extend(part);
            }
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
        match &self.codes {
            Some(codes) => write!(f, "{codes}")?,
            None => writeln!(f, "the model has no network, so it has no golden codes")?,
        }
        match &self.comparison {
            Some(comparison) => write!(f, "{comparison}"),
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
