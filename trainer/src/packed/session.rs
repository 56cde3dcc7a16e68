//! `trainer packed`: fits a packed model to recordings.

use super::blocks::Blocks;
use super::coded::{self, Coded};
use super::evaluation::{self, RateFigures};
use super::integers::{self, INPUT_LIMIT, UNIT_UV, analysed};
use super::probabilities;
use super::ridge::{Ridge, penalty};
use super::scale::Scale;
use super::smoother;
use super::transform::Transform;
use super::unpredicted;
use crate::error::TrainerError;
use crate::output_folder::check_writable;
use crate::progress::ProgressObserver;
use crate::selection::{self, file_name};
use crate::track::read_tracks;
use artifact::{
    Artifact, IntegerMatrix, PackedDescription, PackedModel, PackedTraining, Smoother, slice_ends,
};
use packed::{LEVELS, MAGNITUDES, MAX_COEFFICIENTS, RATES, Rate};
use std::path::{Path, PathBuf};

/// Rate at which the probabilities are trained; the other rates follow from it.
const BASE_RATE: Rate = Rate::MIDDLE;

/// Part of the training data's variance above which a block's unrepresented part is a misfit; in the training
/// data it is 0.002 on average.
const MISFIT: f64 = 0.01;

/// Number of coefficients that represents EEG of 61 electrodes within 0.3 % of its variance.
const COEFFICIENTS: usize = 176;

/// A number of coefficients is a multiple of this, as many inputs as the kernels take at a time.
const ROUND: usize = 16;

/// Rounds of coding the training blocks and counting magnitudes.
const ROUNDS: usize = 4;

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
    /// Number of coefficients; `None` for [`COEFFICIENTS`], or as many as a block allows.
    pub coefficients: Option<usize>,
    /// Mains frequency of the recordings, Hz.
    pub mains_hz: u32,
    /// Mean squared error that the device's first rate may have, in units of `input.sd_uv` squared.
    pub target_mse: Option<f64>,
    /// True to replace a packed model.
    pub force: bool,
}

/// Figures of a trained packed model on the test recordings; without any, on the training recordings.
#[derive(Clone, Debug)]
pub struct PackedTrained {
    /// Of the model at each rate, finest first.
    pub figures: Vec<RateFigures>,
    /// Of the Karhunen-Loeve transform of a block, coded alike but without prediction.
    pub without_prediction: Vec<RateFigures>,
}

/// Trains a packed model and returns its figures.
///
/// # Errors
/// If recordings cannot be used, the wanted error cannot be reached or files cannot be written.
pub fn train(
    options: &PackedOptions,
    observer: &mut impl ProgressObserver,
) -> Result<PackedTrained, TrainerError> {
    let artifact = Artifact::read(&options.artifact)?;
    if artifact.packed.is_some() && !options.force {
        return Err(TrainerError::PackedExists {
            folder: options.artifact.clone(),
        });
    }
    let description = &artifact.description;
    let (hop, sd_uv) = (description.window.hop, description.input.sd_uv);
    let electrodes = description.montage.electrodes.len();
    let count = coefficients(options.coefficients, electrodes * hop)?;
    let train_files = selection::recordings(&options.data, &options.train)?;
    let test_files = selection::recordings(&options.data, &options.test)?;
    selection::refuse_same(&train_files, &test_files)?;
    check_writable(&options.artifact)?;
    let tracks = read_tracks(&train_files, description, options.mains_hz, observer)?;
    let test_tracks = read_tracks(&test_files, description, options.mains_hz, observer)?;
    observer.message("fitting transform and prediction ...");
    let every_quarter: Vec<usize> = (0..hop).step_by((hop / 4).max(1)).collect();
    let transform = Transform::fit(&Blocks::cut(&tracks, hop, sd_uv, &every_quarter), count)?;
    let names = |files: &[PathBuf]| files.iter().map(|file| file_name(file)).collect();
    let mut model = PackedModel {
        description: PackedDescription {
            format: 1,
            coefficients: count,
            rate: BASE_RATE.index(),
            unit_uv: UNIT_UV,
            input_limit: INPUT_LIMIT,
            misfit_uv2: MISFIT * sd_uv.powi(2),
            training: PackedTraining {
                train_files: names(&train_files),
                test_files: names(&test_files),
                figures: Vec::new(),
                without_prediction: Vec::new(),
            },
        },
        analysis: integers::analysis(&transform, &slice_ends(electrodes, hop)),
        prediction: integers::prediction(&transform.prediction),
        predicted_levels: Vec::new(),
        reset_levels: Vec::new(),
        starts: probabilities::starts(&[[[0; MAGNITUDES]; LEVELS]; 2]),
        smoother: Smoother::quantised(&vec![Vec::new(); RATES], 1),
    };
    let blocks = Blocks::cut(&tracks, hop, sd_uv, &[0, hop / 2]);
    let scale = Scale::new(&model, sd_uv);
    let coefficients = analysed(&model, &blocks, sd_uv);
    fit_probabilities(&mut model, &coefficients, scale, observer)?;
    observer.message("fitting the smoother of each rate ...");
    let matrices = Rate::all().map(|rate| {
        let coded = coded::code(&model, &coefficients, rate, usize::MAX);
        smoother::fit(&model, &coded, &coefficients, scale)
    });
    let matrices = matrices.collect::<Result<Vec<_>, _>>()?;
    model.smoother = Smoother::quantised(&matrices, count);
    let tested = if test_tracks.is_empty() {
        observer.message("no test recordings: the figures are those of the training recordings");
        &tracks
    } else {
        &test_tracks
    };
    let figures = evaluation::evaluate(&model, tested, description)?;
    if let Some(target) = options.target_mse {
        let rate = coarsest_within(&figures, target)?;
        model.description.rate = rate;
        observer.message(&format!(
            "rate {rate} is the coarsest with an error of at most {target}"
        ));
    }
    observer.message("fitting the transform without prediction, to compare ...");
    let without_prediction = unpredicted::figures(&model, &tracks, tested, description)?;
    if !test_tracks.is_empty() {
        let rounded =
            |figures: &[RateFigures]| figures.iter().map(|figures| figures.rounded()).collect();
        let card = &mut model.description.training;
        card.figures = rounded(&figures);
        card.without_prediction = rounded(&without_prediction);
    }
    let id = artifact
        .with_packed(Some(model))?
        .write(&options.artifact)?;
    observer.message(&format!(
        "model {id} written to {}",
        options.artifact.display()
    ));
    Ok(PackedTrained {
        figures,
        without_prediction,
    })
}

/// Returns the number of coefficients of a block with this number of values.
fn coefficients(wanted: Option<usize>, values: usize) -> Result<usize, TrainerError> {
    let most = MAX_COEFFICIENTS.min(values) / ROUND * ROUND;
    let count = wanted.unwrap_or(COEFFICIENTS.min(most));
    if count == 0 || count > most || !count.is_multiple_of(ROUND) {
        return Err(TrainerError::Coefficients { count, most });
    }
    Ok(count)
}

/// Measures the packed model in `folder` on recordings at every rate, finest first. `names` selects them in `data` or
/// by path.
///
/// # Errors
/// If the artifact or a recording cannot be used, or the artifact has no packed model.
pub fn compare(
    folder: &Path,
    data: &Path,
    names: &[String],
    mains_hz: u32,
    observer: &mut impl ProgressObserver,
) -> Result<Vec<RateFigures>, TrainerError> {
    let artifact = Artifact::read(folder)?;
    let description = &artifact.description;
    let model = artifact.packed.as_ref().ok_or(TrainerError::NotPacked {
        folder: folder.to_owned(),
    })?;
    let files = selection::recordings(data, names)?;
    let tracks = read_tracks(&files, description, mains_hz, observer)?;
    evaluation::evaluate(model, &tracks, description)
}

/// Returns the coarsest rate whose error at once is at most `target`.
fn coarsest_within(figures: &[RateFigures], target: f64) -> Result<u8, TrainerError> {
    let within = figures.iter().rev().find(|figures| figures.mse <= target);
    within.map(|figures| figures.rate).ok_or_else(|| {
        let least = figures
            .iter()
            .map(|figures| figures.mse)
            .fold(f64::INFINITY, f64::min);
        TrainerError::TargetOutOfReach { target, least }
    })
}

/// Codes the training blocks in rounds, each with the levels and frequencies of the round before.
fn fit_probabilities(
    model: &mut PackedModel,
    coefficients: &[Vec<i16>],
    scale: Scale,
    observer: &mut impl ProgressObserver,
) -> Result<(), TrainerError> {
    let count = model.coefficients();
    // Of the unit of a magnitude: two steps.
    let two_steps = 2.0 * f64::from(BASE_RATE.step());
    let (mut predicted, unpredicted) = first_guess(model, coefficients, two_steps);
    for round in 0..ROUNDS {
        model.predicted_levels = probabilities::levels(&predicted);
        model.reset_levels = probabilities::levels(&unpredicted);
        let coded = coded::code(model, coefficients, BASE_RATE, usize::MAX);
        model.starts = probabilities::starts(&coded::sum(&coded));
        let means = probabilities::mean_magnitudes(&coded, count);
        for (predicted, mean) in predicted.iter_mut().zip(means) {
            *predicted = if round == 0 {
                0.7 * mean + 0.3 * *predicted
            } else {
                mean.max(0.0003)
            };
        }
        if round == 1 {
            model.prediction = refitted_prediction(&coded, coefficients, scale)?;
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
    let predicted = predicted
        .iter()
        .map(|sum| (sum / blocks / two_steps - 0.25).max(0.002));
    let unpredicted = probabilities::mean_sizes(coefficients, count, two_steps);
    (predicted.collect(), unpredicted)
}

fn refitted_prediction(
    coded: &[Coded],
    coefficients: &[Vec<i16>],
    scale: Scale,
) -> Result<IntegerMatrix, TrainerError> {
    let mut ridge = Ridge::new(scale.count, scale.count);
    for (coded, coefficients) in coded.iter().zip(coefficients) {
        let (states, coefficients) = (scale.columns(&coded.states), scale.columns(coefficients));
        let last = states.ncols().saturating_sub(1);
        ridge.add(states.columns(0, last), coefficients.columns(1, last));
    }
    let prediction = ridge.solve(penalty(coded.len()))?;
    Ok(integers::prediction(&prediction))
}
