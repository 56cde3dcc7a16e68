//! Measures the reconstruction error of a model with float and integer codes.

use crate::dataset::{Dataset, Window};
use crate::error::TrainerError;
use crate::network::Network;
use crate::parameters::Parameters;
use artifact::{Artifact, CodeFormat, Geometry, IntegerCode, Mode, ScalpGrid};
use model_gen::IntegerModel;
use packed_fit::in_parallel;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Reconstruction and quantisation errors of a model, measured on a set of windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// Number of measured windows.
    pub windows: usize,
    /// Number of electrodes of the montage.
    pub electrodes: usize,
    /// Reconstruction error with the float encoder's codes.
    pub float: ReconstructionError,
    /// Reconstruction error with the integer encoder's codes.
    pub integer: ReconstructionError,
    /// Format of the integer codes.
    pub format: CodeFormat,
    /// Signal-to-quantisation-noise ratio of the integer codes relative to the float codes, over
    /// all dimensions, dB.
    pub code_sqnr_db: f64,
    /// Number of values that saturated when the windows were quantised.
    pub input_clipped: u64,
    /// Number of values of the integer codes at either end of their range. In formats with an
    /// exponent, only codes with the largest exponent are counted.
    pub code_clipped: u64,
}

/// Error of reconstructed windows over all electrodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReconstructionError {
    /// Mean squared error, in units of `input.sd_uv` squared.
    pub mse: f64,
    /// Mean squared error, in microvolts squared.
    pub mse_uv2: f64,
    /// Percent root-mean-square difference: the root of the sum of the squared errors, divided by
    /// the root of the sum of the squared values.
    pub prd_percent: f64,
}

/// Sums of squares, and counts of clipped values, over all measured windows.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    signal: f64,
    float_error: f64,
    integer_error: f64,
    code: f64,
    code_error: f64,
    input_clipped: u64,
    code_clipped: u64,
}

/// Encoders and decoder of a model that is being measured.
struct Codec {
    network: Network,
    parameters: Parameters,
    grid: ScalpGrid,
    integers: IntegerModel,
    sd_uv: f64,
}

/// A block of windows, with their reconstructions. `windows` has one element for each window; the
/// other slices hold the values of the windows one after the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CodedBlock<'a> {
    /// Windows, in units of `input.sd_uv`.
    pub(crate) windows: &'a [&'a Window],
    /// Windows decoded from the float codes.
    pub(crate) decoded: &'a [f32],
    /// Windows decoded from the integer codes.
    pub(crate) decoded_received: &'a [f32],
}

/// Number of windows that are measured together, which bounds the memory use.
const BLOCK: usize = 1024;

/// Measures a model on the windows of `dataset` at every hop. The dataset is in units of the
/// model's `input.sd_uv`.
///
/// # Errors
/// If the model has no decoder or cannot be turned into integers.
pub(crate) fn evaluate(model: &Artifact, dataset: &Dataset) -> Result<Evaluation, TrainerError> {
    evaluate_blocks(model, dataset, |_| {})
}

/// Measures a model like [`evaluate`], and calls `observe` with each block of windows.
///
/// # Errors
/// If the model has no decoder or cannot be turned into integers.
pub(crate) fn evaluate_blocks(
    model: &Artifact,
    dataset: &Dataset,
    mut observe: impl FnMut(&CodedBlock),
) -> Result<Evaluation, TrainerError> {
    let description = &model.description;
    if description.mode == Mode::Paper {
        return Err(TrainerError::PaperMode);
    }
    let geometry = Geometry::new(description);
    let codec = Codec {
        network: Network::new(description),
        parameters: Parameters::from_tensors(description.mode, geometry, &model.weights)?,
        grid: ScalpGrid::new(description),
        integers: model_gen::quantise(model)?,
        sd_uv: description.input.sd_uv,
    };
    let windows: Vec<&Window> = dataset.aligned(description.window.hop);
    let mut total = Sums::default();
    for block in windows.chunks(BLOCK) {
        codec.measure(block, &mut total, &mut observe);
    }
    let count = (windows.len() * dataset.dimensions().window_electrodes()) as f64;
    let relative = |error: f64| ReconstructionError {
        mse: error / count,
        mse_uv2: error / count * codec.sd_uv.powi(2),
        prd_percent: 100.0 * (error / total.signal).sqrt(),
    };
    Ok(Evaluation {
        windows: windows.len(),
        electrodes: dataset.dimensions().electrodes,
        float: relative(total.float_error),
        integer: relative(total.integer_error),
        format: codec.integers.code_format,
        code_sqnr_db: 10.0 * (total.code / total.code_error).log10(),
        input_clipped: total.input_clipped,
        code_clipped: total.code_clipped,
    })
}

impl Codec {
    /// Encodes and decodes a block of windows, adds the errors of the block to `total`, and passes
    /// the block to `observe`.
    fn measure(
        &self,
        windows: &[&Window],
        total: &mut Sums,
        observe: &mut impl FnMut(&CodedBlock),
    ) {
        let (codes, decoded) = self.network.reconstruct(&self.parameters, windows);
        let integers = in_parallel::map(windows, |window| {
            let (planes, input_clipped) = self.quantise(&self.grid.scatter(window));
            let code = self.integers.encode_window(&planes);
            let code_clipped = at_rails(self.integers.code_format, &code);
            (self.integers.dequantise(&code), input_clipped, code_clipped)
        });
        let mut received = Vec::with_capacity(codes.len());
        for (code, input_clipped, code_clipped) in integers {
            received.extend(code);
            total.input_clipped += input_clipped;
            total.code_clipped += code_clipped;
        }
        total.signal += squares(windows.iter().copied().flatten().copied());
        total.float_error += error(windows, &decoded);
        let decoded_received = self.network.decode(&self.parameters, &received);
        total.integer_error += error(windows, &decoded_received);
        total.code += squares(codes.iter().copied());
        total.code_error += distance(&codes, &received);
        observe(&CodedBlock { windows, decoded: &decoded, decoded_received: &decoded_received });
    }

    /// Returns the quantised window, q = round(uV / scale), and the number of saturated values.
    fn quantise(&self, cells: &[f32]) -> (Vec<i8>, u64) {
        let mut planes = vec![0; cells.len()];
        let mut clipped = 0;
        for (q, value) in planes.iter_mut().zip(cells) {
            let uv = f64::from(*value) * self.sd_uv;
            let rounded = (uv / f64::from(self.integers.input_scale_uv)).round();
            clipped += u64::from(!(-128.0..=127.0).contains(&rounded));
            #[expect(clippy::cast_possible_truncation, reason = "saturates, and is counted")]
            let saturated = rounded as i8;
            *q = saturated;
        }
        (planes, clipped)
    }
}

/// Returns the sum of the squared errors of decoded windows, which are concatenated in `decoded`.
fn error(windows: &[&Window], decoded: &[f32]) -> f64 {
    let length = windows.first().map_or(1, |window| window.len());
    let pairs = windows.iter().zip(decoded.chunks_exact(length));
    pairs.map(|(window, decoded)| distance(window, decoded)).sum()
}

/// Returns the number of values of a code at either end of its format's range. The number is 0
/// below the largest exponent: a smaller exponent is chosen only if it clips no value.
fn at_rails(format: CodeFormat, code: &IntegerCode) -> u64 {
    if code.exponent < format.largest_exponent() {
        return 0;
    }
    let rails = format.range();
    let values = code.values.iter();
    values.filter(|value| rails.contains(value)).count() as u64
}

fn squares(values: impl Iterator<Item = f32>) -> f64 {
    values.map(|value| f64::from(value).powi(2)).sum()
}

fn distance(a: &[f32], b: &[f32]) -> f64 {
    squares(a.iter().zip(b).map(|(a, b)| a - b))
}

/// The table of named evaluations that `trainer` prints.
#[derive(Clone, Debug)]
pub(crate) struct Table<'a>(pub &'a [(&'a str, Evaluation)]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (windows, electrodes) = self
            .0
            .first()
            .map_or((0, 0), |(_, evaluation)| (evaluation.windows, evaluation.electrodes));
        writeln!(f, "{windows} windows; the error is over the {electrodes} electrodes")?;
        writeln!(
            f,
            "{:<14}{:>14}{:>12}{:>12}{:>9}{:>12}{:>16}{:>15}",
            "model",
            "codes",
            "MSE",
            "MSE uV^2",
            "PRD %",
            "SQNR dB",
            "input clipped",
            "codes at rail"
        )?;
        for (name, e) in self.0 {
            for (format, error) in
                [("float".to_owned(), e.float), (e.format.to_string(), e.integer)]
            {
                let ReconstructionError { mse, mse_uv2, prd_percent } = error;
                write!(f, "{name:<14}{format:>14}{mse:>12.5}{mse_uv2:>12.2}{prd_percent:>9.2}")?;
                if format != "float" {
                    write!(
                        f,
                        "{:>12.2}{:>16}{:>15}",
                        e.code_sqnr_db, e.input_clipped, e.code_clipped
                    )?;
                }
                writeln!(f)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn the_error_is_that_outside_the_directions_and_slightly_larger_in_int8() {
        let mut dataset = testing::dataset(9, 256);
        // Scale the data so that the code fills the smallest range that calibration allows.
        dataset.scale(5.0);
        let parameters = testing::pca();
        let model = testing::model(&parameters, &dataset);
        let evaluation = evaluate(&model, &dataset).unwrap();
        let windows = dataset.aligned(8);
        assert_eq!(evaluation.windows, windows.len());
        let seen: Vec<usize> = (0..testing::directions().len()).map(testing::feature).collect();
        let (mut lost, mut signal) = (0.0, 0.0);
        for window in &windows {
            for (feature, value) in window.iter().enumerate() {
                let square = f64::from(*value).powi(2);
                signal += square;
                lost += if seen.contains(&feature) { 0.0 } else { square };
            }
        }
        let expected = 100.0 * (lost / signal).sqrt();
        assert!((evaluation.float.prd_percent - expected).abs() < 1e-3);
        assert!(evaluation.integer.mse > evaluation.float.mse);
        // Input and code are each quantised to about 1/200 of their range, which limits the ratio
        // of signal to quantisation noise. 38 dB were measured.
        assert!(evaluation.code_sqnr_db > 35.0, "{evaluation:?}");
        assert_eq!(evaluation.input_clipped, 0);
        let ratio = evaluation.float.mse_uv2 / evaluation.float.mse;
        assert!((ratio - 47.3_f64.powi(2)).abs() < 1e-6);
        dataset.scale(10.0);
        assert!(evaluate(&model, &dataset).unwrap().input_clipped > 0);
    }

    #[test]
    fn wider_code_formats_have_less_error_and_clip_nothing() {
        let mut dataset = testing::dataset(9, 64);
        let parameters = testing::pca();
        let mut model = testing::model(&parameters, &dataset);
        // The scaled data exceed the head room of int8 codes, but not the head room of the other
        // formats or of the input.
        let shape = [testing::directions().len()];
        for name in ["code.min", "code.max"] {
            let range = model.calibration.tensor(name, &shape).unwrap();
            let less = range.iter().map(|end| end / 9.0).collect();
            model.calibration.insert(name, &shape, less);
        }
        dataset.scale(1.2);
        let mut evaluation = |format| {
            model.description.code.format = format;
            let evaluation = evaluate(&model, &dataset).unwrap();
            assert_eq!(evaluation.format, format);
            evaluation
        };
        let int8 = evaluation(CodeFormat::Int8);
        let exponent = evaluation(CodeFormat::Int8Exponent);
        let int16 = evaluation(CodeFormat::Int16);
        assert!(int8.code_clipped > 0, "{int8:?}");
        assert_eq!((exponent.code_clipped, int16.code_clipped), (0, 0));
        assert!(exponent.code_sqnr_db > int8.code_sqnr_db);
        assert!(int16.code_sqnr_db > exponent.code_sqnr_db);
    }
}
