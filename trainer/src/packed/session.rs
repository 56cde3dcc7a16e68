//! `trainer packed`: fits a packed model to recordings.

use super::blocks::Blocks;
use super::coded::{self, Coded, Histogram};
use super::corrections::{self, columns};
use super::evaluation::{self, RateFigures};
use super::integers::{self, COEFFICIENT_UV, INPUT_LIMIT, INPUT_UV};
use super::probabilities;
use super::ridge::Ridge;
use super::transform::{PENALTY, Transform, to_f32};
use crate::error::TrainerError;
use crate::in_parallel;
use crate::progress::ProgressObserver;
use crate::selection::{self, file_name};
use crate::track::read_tracks;
use artifact::{Artifact, PackedDescription, PackedModel, PackedTraining};
use nalgebra::DMatrix;
use packed::{LEVELS, MAGNITUDES, Rate};
use std::path::PathBuf;

/// Rounds of coding the training blocks and counting magnitudes.
const ROUNDS: usize = 4;

/// Blocks from one reset to the next: 4 s.
const RESET: usize = 64;

/// Options of `trainer packed`.
#[derive(Clone, Debug)]
pub struct PackedOptions {
    /// Folder of the artifact that the packed model joins.
    pub artifact: PathBuf,
    /// Folder in which names select recordings.
    pub data: PathBuf,
    /// Paths, patterns, names or ranges of the training recordings.
    pub train: Vec<String>,
    /// Paths, patterns, names or ranges of the test recordings.
    pub test: Vec<String>,
    /// Number of coefficients.
    pub coefficients: usize,
    /// Mains frequency of the recordings, Hz.
    pub mains_hz: u32,
}

/// Trains a packed model and returns its figures on the test recordings.
///
/// # Errors
/// If recordings cannot be used.
pub fn train(
    options: &PackedOptions,
    observer: &mut impl ProgressObserver,
) -> Result<(PackedModel, Vec<RateFigures>), TrainerError> {
    let artifact = Artifact::read(&options.artifact)?;
    let description = &artifact.description;
    let (hop, sd_uv) = (description.window.hop, description.input.sd_uv);
    let read = |names: &[String], observer: &mut _| {
        let files = selection::recordings(&options.data, names)?;
        let tracks = read_tracks(&files, description, options.mains_hz, observer)?;
        Ok::<_, TrainerError>((files, tracks))
    };
    let (train_files, tracks) = read(&options.train, observer)?;
    let (test_files, test_tracks) = read(&options.test, observer)?;
    observer.message("fitting transform and prediction ...");
    let every_quarter: Vec<usize> = (0..hop).step_by((hop / 4).max(1)).collect();
    let transform = Transform::fit(
        &Blocks::cut(&tracks, hop, sd_uv, &every_quarter),
        options.coefficients,
    )?;
    let blocks = Blocks::cut(&tracks, hop, sd_uv, &[0, hop / 2]);
    let electrodes = description.montage.electrodes.len();
    let slices = slices(electrodes, hop);
    let names = |files: &[PathBuf]| files.iter().map(|file| file_name(file)).collect();
    let mut model = PackedModel {
        description: PackedDescription {
            format: 1,
            coefficients: options.coefficients,
            rate: 4,
            input_uv: INPUT_UV,
            input_limit: INPUT_LIMIT,
            coefficient_uv: COEFFICIENT_UV,
            training: PackedTraining {
                train_files: names(&train_files),
                test_files: names(&test_files),
                figures: Vec::new(),
            },
        },
        analysis: integers::analysis(&transform, &slices),
        prediction: integers::prediction(&transform.prediction),
        predicted_levels: Vec::new(),
        reset_levels: Vec::new(),
        starts: probabilities::starts(&[[[0; MAGNITUDES]; LEVELS]; 2]),
        corrections: Vec::new(),
    };
    let unit = COEFFICIENT_UV / sd_uv;
    let coefficients = analysed(&model, &blocks, sd_uv);
    let test_blocks = Blocks::cut(&test_tracks, hop, sd_uv, &[0]);
    let test_coefficients = analysed(&model, &test_blocks, sd_uv);
    fit_integers(&mut model, &coefficients, unit, observer)?;
    let synthesis = synthesis(&model, sd_uv);
    let mut figures = Vec::new();
    for rate in (0..10).filter_map(Rate::new) {
        let coded = coded::code(&model, &coefficients, rate, usize::MAX);
        let correction = corrections::fit(
            rate.index(),
            &coded,
            &coefficients,
            options.coefficients,
            unit,
        )?;
        let tested = coded::code(&model, &test_coefficients, rate, RESET);
        let measured = evaluation::measure(&test_blocks, &tested, &correction, &synthesis, unit);
        observer.message(&format!("{measured:?}"));
        figures.push(measured);
        model.corrections.push(correction);
    }
    Ok((model, figures))
}

/// Returns the ends of the inputs that a device adds to the analysis at each step: a multiple of 16, except for
/// the last.
fn slices(electrodes: usize, hop: usize) -> Vec<usize> {
    let mut ends: Vec<usize> = (1..hop).map(|steps| steps * electrodes / 16 * 16).collect();
    ends.push(hop * electrodes);
    ends
}

fn analysed(model: &PackedModel, blocks: &Blocks, sd_uv: f64) -> Vec<Vec<i16>> {
    let limit = f64::from(INPUT_LIMIT);
    in_parallel::map(&blocks.sequences, |blocks| {
        let block = |values: nalgebra::DVectorView<'_, f32>| {
            let inputs: Vec<i16> = values
                .iter()
                .map(|&value| {
                    let value = (f64::from(value) * sd_uv / INPUT_UV).round();
                    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
                    let value = value.clamp(-limit, limit) as i16;
                    value
                })
                .collect();
            model.analyse(&inputs)
        };
        blocks.column_iter().flat_map(block).collect()
    })
}

/// Codes the training blocks in rounds, each with the levels and frequencies of the round before.
fn fit_integers(
    model: &mut PackedModel,
    coefficients: &[Vec<i16>],
    unit: f64,
    observer: &mut impl ProgressObserver,
) -> Result<(), TrainerError> {
    let count = model.coefficients();
    let rate = Rate::new(model.description.rate).expect("a rate of 16");
    // Of the unit of a magnitude: two steps.
    let two_steps = 2.0 * f64::from(rate.step());
    let (mut predicted, unpredicted) = first_guess(model, coefficients, two_steps);
    for round in 0..ROUNDS {
        model.predicted_levels = probabilities::levels(&predicted);
        model.reset_levels = probabilities::levels(&unpredicted);
        let coded = coded::code(model, coefficients, rate, usize::MAX);
        model.starts = probabilities::starts(&sum(&coded));
        let means = probabilities::mean_magnitudes(&coded, count);
        for (predicted, mean) in predicted.iter_mut().zip(means) {
            *predicted = if round == 0 {
                0.7 * mean + 0.3 * *predicted
            } else {
                mean.max(0.0003)
            };
        }
        if round == 1 {
            model.prediction = refitted_prediction(&coded, coefficients, count, unit)?;
        }
        let bytes = coded.iter().flat_map(|coded| &coded.bytes);
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53")]
        let bits = 8.0 * bytes.clone().sum::<usize>() as f64 / bytes.count().max(1) as f64;
        observer.message(&format!("round {}: {bits:.1} bits a block", round + 1));
    }
    model.predicted_levels = probabilities::levels(&predicted);
    Ok(())
}

/// Returns guesses of the mean magnitudes of predicted blocks and of blocks without prediction.
fn first_guess(
    model: &PackedModel,
    coefficients: &[Vec<i16>],
    two_steps: f64,
) -> (Vec<f64>, Vec<f64>) {
    let count = model.coefficients();
    let (mut predicted, mut unpredicted) = (vec![0.0; count], vec![0.0; count]);
    let mut blocks = 0.0_f64;
    for sequence in coefficients {
        let before = sequence.chunks_exact(count);
        for (before, block) in before.zip(sequence.chunks_exact(count).skip(1)) {
            blocks += 1.0;
            let prediction = model.predict(before);
            for j in 0..count {
                let residual = f64::from(block[j]) - f64::from(prediction[j]);
                predicted[j] += residual.abs();
                unpredicted[j] += (f64::from(block[j]).abs() / two_steps - 0.2).max(0.0);
            }
        }
    }
    let blocks = blocks.max(1.0);
    let predicted = predicted
        .iter()
        .map(|sum| (sum / blocks / two_steps - 0.25).max(0.002));
    let unpredicted = unpredicted.iter().map(|sum| sum / blocks + 0.0005);
    (predicted.collect(), unpredicted.collect())
}

fn sum(coded: &[Coded]) -> Box<Histogram> {
    let mut sum = Box::new([[[0; MAGNITUDES]; LEVELS]; 2]);
    for coded in coded {
        let counts = coded.histogram.iter().flatten().flatten();
        for (sum, count) in sum.iter_mut().flatten().flatten().zip(counts) {
            *sum += count;
        }
    }
    sum
}

fn refitted_prediction(
    coded: &[Coded],
    coefficients: &[Vec<i16>],
    count: usize,
    unit: f64,
) -> Result<artifact::IntegerMatrix, TrainerError> {
    let mut ridge = Ridge::new(count, count);
    for (coded, coefficients) in coded.iter().zip(coefficients) {
        let states = columns(&coded.states, count, unit);
        let last = states.ncols().saturating_sub(1);
        ridge.add(
            &states.columns(0, last).into_owned(),
            &columns(coefficients, count, unit)
                .columns(1, last)
                .into_owned(),
        );
    }
    #[expect(clippy::cast_precision_loss, reason = "a few hundred sequences")]
    let penalty = PENALTY * coded.len() as f64;
    let prediction = ridge.solve(penalty).ok_or(TrainerError::Silent)?;
    Ok(integers::prediction(&prediction))
}

/// Returns the pseudoinverse of the analysis, `[value, coefficient]`, both in units of `input.sd_uv`.
fn synthesis(model: &PackedModel, sd_uv: f64) -> DMatrix<f32> {
    let _ = sd_uv;
    let count = model.coefficients();
    let analysis =
        DMatrix::from_row_slice(count, model.analysis.inputs(), &model.analysis.to_float());
    let gram = &analysis * analysis.transpose();
    let inverse = gram
        .cholesky()
        .expect("directions are independent")
        .inverse();
    to_f32(&(analysis.transpose() * inverse))
}
