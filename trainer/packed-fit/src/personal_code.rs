//! A linear code for one person, and its error compared with another network's.

use crate::directions::{principal_directions, second_moment};
use crate::error::FitError;
use crate::good_signal::{GoodSignal, first_three_quarters};
use crate::in_parallel;
use crate::track::Track;
use artifact::reconstruction::WindowDecoder;
use artifact::{Artifact, Description, Pca, ScalpGrid};
use nalgebra::DMatrix;

/// Smallest calibrated range of a code value: +-10 standard deviations of the input.
///
/// Muscle activity or a moving cap excites code values that hardly vary in the training data. With
/// model-gen's head room of 2, one level of a value with this range is 10 * 2 / 127 = 0.16. On
/// EEGMMIDB S001 R11 and R12 this limit increases the error (int8 MSE 0.0041, without it 0.0039,
/// float 0.0030), but it protects recordings that differ more from their training set.
pub const MIN_RANGE: f32 = 10.0;

/// A linear code that was fitted to a person's signal.
#[derive(Clone, Debug)]
pub struct PersonalCode {
    /// A model of mode `pca`, fitted to the whole signal. Windows, input scale, code format, packed
    /// model and table of substitutions are taken from the other model in the comparison.
    pub model: Artifact,
    /// Percent root-mean-square difference between the last quarter of the signal and its
    /// reconstruction from integer codes, with a code that was fitted to the first three quarters.
    pub own_prd: f64,
    /// Percent root-mean-square difference between the last quarter of the signal and its
    /// reconstruction from the other model's integer codes.
    pub other_prd: f64,
}

impl PersonalCode {
    /// Fits a code with as many values as the codes of `other`, and compares it with `other`.
    ///
    /// # Errors
    /// If codes of `other` have more values than a window, or a model cannot be turned into
    /// integers.
    pub fn new(signal: &GoodSignal, other: &Artifact) -> Result<Self, FitError> {
        let [first, last] = first_three_quarters(&signal.tracks);
        Ok(Self {
            model: fit(&signal.tracks, other)?,
            own_prd: prd(&fit(&first, other)?, &last)?,
            other_prd: prd(other, &last)?,
        })
    }
}

/// Returns the windows of a track at every hop, microvolts, in the order step, electrode.
fn windows<'t>(
    track: &'t Track,
    description: &Description,
) -> impl Iterator<Item = &'t [f32]> + use<'t> {
    let length = description.dimensions().window_electrodes();
    let hop = description.window.hop * track.electrodes;
    let starts = (0..).step_by(hop);
    starts.map_while(move |start| track.values.get(start..start + length))
}

/// Fits the principal directions of all windows, and the ranges of their codes.
fn fit(tracks: &[Track], other: &Artifact) -> Result<Artifact, FitError> {
    let description = &other.description;
    let dimensions = description.dimensions();
    let (numbers, values) = (dimensions.numbers, dimensions.window_electrodes());
    if numbers > values {
        return Err(FitError::Numbers { numbers, values });
    }
    #[expect(clippy::cast_possible_truncation, reason = "a float network takes f32")]
    let to_input = |uv: &f32| (f64::from(*uv) / description.input.sd_uv) as f32;
    let columns = tracks.iter().map(|track| {
        let inputs: Vec<f32> = windows(track, description).flatten().map(to_input).collect();
        DMatrix::from_vec(values, inputs.len() / values, inputs)
    });
    let columns: Vec<DMatrix<f32>> = columns.collect();
    let directions = principal_directions(second_moment(&columns), numbers);
    let rows = DMatrix::from_row_iterator(numbers, values, directions.iter().flatten().copied());
    let mut ranges = [vec![-MIN_RANGE; numbers], vec![MIN_RANGE; numbers]];
    for code in columns.iter().map(|columns| &rows * columns) {
        for (number, z) in code.row_iter().enumerate() {
            ranges[0][number] = ranges[0][number].min(z.min());
            ranges[1][number] = ranges[1][number].max(z.max());
        }
    }
    let pca = Pca::new(&directions, ranges, other.largest_input_uv()?);
    let model = pca.to_model(description.clone())?;
    let model = model.with_packed(other.packed.clone())?;
    Ok(model.with_substitution(other.substitution.clone())?)
}

/// Returns the percent RMS difference between all windows and their decoded integer codes.
fn prd(model: &Artifact, tracks: &[Track]) -> Result<f64, FitError> {
    let integers = model_gen::quantise(model)?;
    let decoder = WindowDecoder::new(model)?;
    let grid = ScalpGrid::new(&model.description);
    #[expect(clippy::cast_possible_truncation, reason = "saturates, as on a device")]
    let level = |uv: &f32| (uv / integers.input_scale_uv).round() as i8;
    let windows = tracks.iter().flat_map(|track| windows(track, &model.description));
    let sums = in_parallel::map(&windows.collect::<Vec<_>>(), |window| {
        let planes: Vec<i8> = grid.scatter(window).iter().map(level).collect();
        let code = integers.dequantise(&integers.encode_window(&planes));
        let decoded = decoder.decode(&code);
        let errors = window.iter().zip(&decoded).map(|(uv, decoded)| uv - decoded);
        [squares(errors), squares(window.iter().copied())]
    });
    let [error, signal] = [0, 1].map(|at| sums.iter().map(|sums| sums[at]).sum::<f64>());
    Ok(100.0 * (error / signal).sqrt())
}

fn squares(values: impl Iterator<Item = f32>) -> f64 {
    values.map(|value| f64::from(value).powi(2)).sum()
}
