//! Fit of a packed model to filtered recordings.

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
use crate::progress::ProgressObserver;
use crate::selection::{self, file_name};
use crate::track::{Track, read_tracks};
use artifact::{
    Description, INPUTS_PER_ROUND, IntegerMatrix, PackedDescription, PackedModel, PackedTraining,
    Smoother, slice_ends,
};
use packed::{LEVELS, MAGNITUDES, MAX_COEFFICIENTS, RATES, Rate};
use std::path::PathBuf;

/// Rate at which the probabilities are trained; the other rates follow from it.
const BASE_RATE: Rate = Rate::MIDDLE;

/// Part of the training data's variance above which a block's unrepresented part is a misfit; in the training
/// data it is 0.002 on average.
const MISFIT: f64 = 0.01;

/// Number of coefficients that represents EEG of 61 electrodes within 0.3 % of its variance.
const COEFFICIENTS: usize = 176;

/// Rounds of coding the training blocks and counting magnitudes.
const ROUNDS: usize = 4;

/// Recordings and settings of a packed model.
#[derive(Clone, Debug)]
pub struct FitOptions {
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
}

/// Figures of a trained packed model on the test recordings; without any, on the training recordings.
#[derive(Clone, Debug)]
pub struct PackedTrained {
    /// Of the model at each rate, finest first.
    pub figures: Vec<RateFigures>,
    /// Of the Karhunen-Loeve transform of a block, coded alike but without prediction.
    pub without_prediction: Vec<RateFigures>,
}

/// Recordings that are selected for a fit, none of them twice.
pub(super) struct Selected {
    train: Vec<PathBuf>,
    test: Vec<PathBuf>,
}

/// Filtered recordings.
pub(super) struct Tracks {
    pub(super) train: Vec<Track>,
    pub(super) test: Vec<Track>,
}

impl Selected {
    pub(super) fn find(options: &FitOptions) -> Result<Self, TrainerError> {
        let train = selection::recordings(&options.data, &options.train)?;
        let test = selection::recordings(&options.data, &options.test)?;
        selection::refuse_same(&train, &test)?;
        Ok(Self { train, test })
    }

    pub(super) fn read(
        &self,
        description: &Description,
        mains_hz: u32,
        observer: &mut impl ProgressObserver,
    ) -> Result<Tracks, TrainerError> {
        Ok(Tracks {
            train: read_tracks(&self.train, description, mains_hz, observer)?,
            test: read_tracks(&self.test, description, mains_hz, observer)?,
        })
    }

    /// File names of the training recordings, and of the test recordings.
    pub(super) fn names(&self) -> [Vec<String>; 2] {
        [&self.train, &self.test].map(|files| files.iter().map(|file| file_name(file)).collect())
    }
}

/// Returns the number of coefficients of a block of this description's montage and hop.
///
/// # Errors
/// If a block cannot have the wanted number.
pub(super) fn coefficients(
    wanted: Option<usize>,
    description: &Description,
) -> Result<usize, TrainerError> {
    let values = description.montage.electrodes.len() * description.window.hop;
    let most = MAX_COEFFICIENTS.min(values) / INPUTS_PER_ROUND * INPUTS_PER_ROUND;
    let count = wanted.unwrap_or(COEFFICIENTS.min(most));
    if count == 0 || count > most || !count.is_multiple_of(INPUTS_PER_ROUND) {
        return Err(TrainerError::Coefficients { count, most });
    }
    Ok(count)
}

/// Fits a packed model with `count` coefficients, and returns it with its figures.
///
/// # Errors
/// If the recordings do not determine a model, or no rate reaches `target_mse`.
pub(super) fn fit(
    tracks: &Tracks,
    description: &Description,
    count: usize,
    target_mse: Option<f64>,
    observer: &mut impl ProgressObserver,
) -> Result<(PackedModel, PackedTrained), TrainerError> {
    let mut model = fit_model(&tracks.train, description, count, observer)?;
    let tested = if tracks.test.is_empty() {
        observer.message("no test recordings: the figures are those of the training recordings");
        &tracks.train
    } else {
        &tracks.test
    };
    let figures = evaluation::evaluate(&model, tested, description)?;
    if let Some(target) = target_mse {
        let rate = coarsest_within(&figures, target)?;
        model.description.rate = rate;
        observer.message(&format!(
            "rate {rate} is the coarsest with an error of at most {target}"
        ));
    }
    observer.message("fitting the transform without prediction, to compare ...");
    let without_prediction = unpredicted::figures(&model, &tracks.train, tested, description)?;
    if !tracks.test.is_empty() {
        let rounded =
            |figures: &[RateFigures]| figures.iter().map(|figures| figures.rounded()).collect();
        let card = &mut model.description.training;
        card.figures = rounded(&figures);
        card.without_prediction = rounded(&without_prediction);
    }
    let trained = PackedTrained {
        figures,
        without_prediction,
    };
    Ok((model, trained))
}

fn fit_model(
    tracks: &[Track],
    description: &Description,
    count: usize,
    observer: &mut impl ProgressObserver,
) -> Result<PackedModel, TrainerError> {
    let (hop, sd_uv) = (description.window.hop, description.input.sd_uv);
    let electrodes = description.montage.electrodes.len();
    observer.message("fitting transform and prediction ...");
    let every_quarter: Vec<usize> = (0..hop).step_by((hop / 4).max(1)).collect();
    let transform = Transform::fit(&Blocks::cut(tracks, hop, sd_uv, &every_quarter), count)?;
    let mut model = PackedModel {
        description: PackedDescription {
            format: 1,
            coefficients: count,
            rate: BASE_RATE.index(),
            unit_uv: UNIT_UV,
            input_limit: INPUT_LIMIT,
            misfit_uv2: MISFIT * sd_uv.powi(2),
            training: PackedTraining::default(),
        },
        analysis: integers::analysis(&transform, &slice_ends(electrodes, hop)),
        prediction: integers::prediction(&transform.prediction),
        predicted_levels: Vec::new(),
        reset_levels: Vec::new(),
        starts: probabilities::starts(&[[[0; MAGNITUDES]; LEVELS]; 2]),
        smoother: Smoother::quantised(&vec![Vec::new(); RATES], 1),
    };
    let blocks = Blocks::cut(tracks, hop, sd_uv, &[0, hop / 2]);
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
    Ok(model)
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
    let largest = integers::largest_prediction(scale.count);
    let prediction = ridge.solve_within(penalty(coded.len()), largest)?;
    Ok(integers::prediction(&prediction))
}
