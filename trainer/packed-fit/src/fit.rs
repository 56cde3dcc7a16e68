//! Fits a packed model to filtered recordings.

use crate::coded::{self, Coded};
use crate::error::FitError;
use crate::evaluation::{self, RateFigures};
use crate::integers::{self, INPUT_LIMIT, Scale, UNIT_UV, analysed};
use crate::probabilities;
use crate::ridge::{PENALTY, Ridge, fit_smoother};
use crate::track::Track;
use crate::transform::{Blocks, Transform, to_f32};
use crate::weight::Metric;
use artifact::{
    Description, ErrorWeight, INPUTS_PER_ROUND, IntegerMatrix, PackedDescription, PackedModel,
    PackedTraining, Smoother, slice_ends,
};
use nalgebra::DMatrix;
use packed::{LEVELS, MAGNITUDES, MAX_COEFFICIENTS, RATES, Rate};

/// Rate at which the probabilities are trained; the probabilities at other rates follow from those
/// at this rate.
const BASE_RATE: Rate = Rate::MIDDLE;

/// Smallest misfit threshold, in units of the training data's variance. A block is a misfit if the
/// mean square of the part that the coefficients do not represent is above the threshold. In
/// recordings of one person (EEGMMIDB S001) this mean square is 0.002 on average.
const MISFIT: f64 = 0.01;

/// Smallest ratio of the misfit threshold to the mean square of the part of the training data that
/// the coefficients do not represent. With several people in the training data, this mean square is
/// larger.
const MISFIT_RATIO: f64 = 4.0;

/// Default number of coefficients of a block: enough to represent EEG of 61 electrodes within 0.3 %
/// of its variance.
const COEFFICIENTS: usize = 176;

/// Number of rounds in which the probabilities are trained. Each round codes the training blocks
/// and counts the magnitudes.
const ROUNDS: usize = 4;

/// Returns the number of coefficients of a block: `wanted` if it is given, otherwise the default
/// for the description's montage and hop.
///
/// # Errors
/// If a block cannot have this number of coefficients.
pub fn coefficients(wanted: Option<usize>, description: &Description) -> Result<usize, FitError> {
    let values = description.montage.electrodes.len() * description.window.hop;
    let most = MAX_COEFFICIENTS.min(values) / INPUTS_PER_ROUND * INPUTS_PER_ROUND;
    let count = wanted.unwrap_or(COEFFICIENTS.min(most));
    if count == 0 || count > most || !count.is_multiple_of(INPUTS_PER_ROUND) {
        return Err(FitError::Coefficients { count, most });
    }
    Ok(count)
}

/// Fits a packed model with `count` coefficients to filtered recordings, for the least error,
/// weighted by `weight` if it is given. Reports its progress to `report`.
///
/// # Errors
/// If the recordings do not determine a model.
pub fn fit(
    tracks: &[Track],
    description: &Description,
    count: usize,
    weight: Option<ErrorWeight>,
    report: &mut dyn FnMut(&str),
) -> Result<PackedModel, FitError> {
    let (hop, sd_uv) = (description.window.hop, description.input.sd_uv);
    let electrodes = description.montage.electrodes.len();
    report("fitting transform and prediction ...");
    let blocks = Blocks::cut(tracks, hop, sd_uv, &every_quarter(hop));
    let metric = weight.map(|weight| Metric::new(weight, tracks, hop, description.window.rate_hz));
    let metric = metric.transpose()?;
    let transform = match &metric {
        Some(metric) => {
            // The points of a quantiser are two steps apart. The mean squared error is the square
            // of this distance over 12.
            let distance = 2.0 * f64::from(BASE_RATE.step()) * UNIT_UV / sd_uv;
            let theta = distance.powi(2) / 12.0;
            Transform::fit_weighted(&blocks, count, metric, electrodes, theta)?
        }
        None => Transform::fit(&blocks, count)?,
    };
    let misfit = MISFIT.max(MISFIT_RATIO * transform.unrepresented(&blocks, weight.is_some()));
    let mut model = PackedModel {
        description: PackedDescription {
            format: 1,
            coefficients: count,
            rate: BASE_RATE.index(),
            unit_uv: UNIT_UV,
            input_limit: INPUT_LIMIT,
            misfit_uv2: misfit * sd_uv.powi(2),
            weight,
            training: PackedTraining::default(),
        },
        analysis: integers::analysis(&transform, &slice_ends(electrodes, hop)),
        prediction: integers::prediction(&transform.prediction),
        predicted_levels: Vec::new(),
        reset_levels: Vec::new(),
        starts: probabilities::starts(&[[[0; MAGNITUDES]; LEVELS]; 2]),
        smoother: Smoother::quantised(&vec![Vec::new(); RATES], 1),
        synthesis: None,
    };
    if let Some(metric) = &metric {
        model.synthesis = Some(synthesis(&model, metric)?);
    }
    let blocks = Blocks::cut(tracks, hop, sd_uv, &[0, hop / 2]);
    let scale = Scale::new(&model, sd_uv);
    let coefficients = analysed(&model, &blocks, sd_uv);
    fit_probabilities(&mut model, &coefficients, scale, report)?;
    report("fitting the smoother of each rate ...");
    let matrices = Rate::all().map(|rate| {
        let coded = coded::code(&model, &coefficients, rate, usize::MAX);
        fit_smoother(&model, &coded, &coefficients, scale)
    });
    let matrices = matrices.collect::<Result<Vec<_>, _>>()?;
    model.smoother = Smoother::quantised(&matrices, count);
    Ok(model)
}

/// Returns the synthesis with the least weighted error, `[coefficient][value]`:
/// `(A M^-1 A')^-1 A M^-1`, with analysis A and metric M.
fn synthesis(model: &PackedModel, metric: &Metric) -> Result<Vec<f32>, FitError> {
    let (count, values) = (model.coefficients(), model.analysis.inputs());
    let analysis = DMatrix::from_row_slice(count, values, &model.analysis.to_float());
    let weighted = &analysis * metric.inverse();
    let gram = &weighted * analysis.transpose();
    let synthesis = gram.cholesky().ok_or(FitError::Silent)?.solve(&weighted);
    Ok(to_f32(&synthesis.transpose()).as_slice().to_vec())
}

/// Returns the steps at which four series of blocks begin, a quarter of a block apart.
fn every_quarter(hop: usize) -> Vec<usize> {
    (0..hop).step_by((hop / 4).max(1)).collect()
}

/// Fits levels and frequencies in rounds. Each round codes the training blocks with the levels and
/// frequencies of the previous round.
fn fit_probabilities(
    model: &mut PackedModel,
    coefficients: &[Vec<i16>],
    scale: Scale,
    report: &mut dyn FnMut(&str),
) -> Result<(), FitError> {
    let count = model.coefficients();
    // A magnitude of 1 stands for a coefficient of two quantiser steps.
    let two_steps = 2.0 * f64::from(BASE_RATE.step());
    let (mut predicted, unpredicted) = first_guess(model, coefficients, two_steps);
    for round in 0..ROUNDS {
        model.predicted_levels = probabilities::levels(&predicted);
        model.reset_levels = probabilities::levels(&unpredicted);
        let coded = coded::code(model, coefficients, BASE_RATE, usize::MAX);
        model.starts = probabilities::starts(&coded::sum(&coded));
        let means = probabilities::mean_magnitudes(&coded, count);
        for (predicted, mean) in predicted.iter_mut().zip(means) {
            *predicted = if round == 0 { 0.7 * mean + 0.3 * *predicted } else { mean.max(0.0003) };
        }
        if round == 1 {
            model.prediction = refitted_prediction(&coded, coefficients, scale)?;
        }
        let bytes = coded.iter().flat_map(|coded| &coded.bytes);
        let bits = 8.0 * bytes.clone().sum::<usize>() as f64 / bytes.count().max(1) as f64;
        report(&format!("round {}: {bits:.1} bits a block", round + 1));
    }
    model.predicted_levels = probabilities::levels(&predicted);
    Ok(())
}

/// Returns estimates of each coefficient's mean magnitude: first in predicted blocks, then in
/// blocks without prediction. A coefficient of `two_steps` has magnitude 1.
fn first_guess(
    model: &PackedModel,
    coefficients: &[Vec<i16>],
    two_steps: f64,
) -> (Vec<f64>, Vec<f64>) {
    let count = model.coefficients();
    let mut predicted = vec![0.0; count];
    let mut blocks = 0.0_f64;
    for sequence in coefficients {
        let before = sequence.chunks_exact(count);
        for (before, block) in before.zip(sequence.chunks_exact(count).skip(1)) {
            blocks += 1.0;
            let prediction = model.predict(before);
            for j in 0..count {
                let residual = f64::from(block[j]) - f64::from(prediction[j]);
                predicted[j] += residual.abs();
            }
        }
    }
    let blocks = blocks.max(1.0);
    let predicted = predicted.iter().map(|sum| (sum / blocks / two_steps - 0.25).max(0.002));
    let unpredicted = probabilities::mean_sizes(coefficients, count, two_steps);
    (predicted.collect(), unpredicted)
}

fn refitted_prediction(
    coded: &[Coded],
    coefficients: &[Vec<i16>],
    scale: Scale,
) -> Result<IntegerMatrix, FitError> {
    let mut ridge = Ridge::new(scale.count, scale.count);
    for (coded, coefficients) in coded.iter().zip(coefficients) {
        let (states, coefficients) = (scale.columns(&coded.states), scale.columns(coefficients));
        let last = states.ncols().saturating_sub(1);
        ridge.add(states.columns(0, last), coefficients.columns(1, last));
    }
    let largest = integers::largest_prediction(scale.count);
    let prediction = ridge.solve_within(PENALTY, largest)?;
    Ok(integers::prediction(&prediction))
}

/// Fits the Karhunen-Loeve transform of a block to `tracks`, with as many coefficients as `model`
/// has. Every block is coded without prediction, but with the quantiser, contexts and range coder
/// of the packed code, and all errors have equal weight. Returns the figures of this code on
/// `tested` at every rate, finest first. An unweighted packed model differs only by its prediction,
/// so the difference of the figures is the gain from prediction.
///
/// # Errors
/// If the recordings are silent.
pub fn without_prediction(
    model: &PackedModel,
    tracks: &[Track],
    tested: &[Track],
    description: &Description,
) -> Result<Vec<RateFigures>, FitError> {
    let (hop, sd_uv) = (description.window.hop, description.input.sd_uv);
    let electrodes = description.montage.electrodes.len();
    let blocks = Blocks::cut(tracks, hop, sd_uv, &every_quarter(hop));
    let transform = Transform::without_prediction(&blocks, model.coefficients());
    let mut model = PackedModel {
        analysis: integers::analysis(&transform, &slice_ends(electrodes, hop)),
        synthesis: None,
        ..model.clone()
    };
    let blocks = Blocks::cut(tracks, hop, sd_uv, &[0, hop / 2]);
    let coefficients = analysed(&model, &blocks, sd_uv);
    let two_steps = 2.0 * f64::from(BASE_RATE.step());
    let mut means = probabilities::mean_sizes(&coefficients, model.coefficients(), two_steps);
    for _ in 0..ROUNDS {
        model.reset_levels = probabilities::levels(&means);
        let coded = coded::code(&model, &coefficients, BASE_RATE, 1);
        model.starts = probabilities::starts(&coded::sum(&coded));
        means = probabilities::mean_magnitudes(&coded, model.coefficients());
    }
    model.reset_levels = probabilities::levels(&means);
    let figures = evaluation::evaluate_with_resets(&model, tested, description, 1, &mut |_| ())?;
    // A block without prediction has no information on the previous block, so nothing is smoothed.
    let alone = |figures: RateFigures| RateFigures { mse_smoothed: figures.mse, ..figures };
    Ok(figures.into_iter().map(alone).collect())
}
