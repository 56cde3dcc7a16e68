//! Trains a model from recordings, and evaluates a trained model.

use crate::calibrate::calibrated_artifact;
use crate::dataset::{Dataset, Split};
use crate::error::TrainerError;
use crate::evaluate::{Evaluation, evaluate};
use crate::golden::golden_windows;
use crate::network::Network;
use crate::parameters::Parameters;
use crate::selection::file_name;
use crate::track::{SETTLING_S, Track};
use crate::training::{EpochReport, Settings, Training};
use crate::{card, checkpoint, pca, selection};
use artifact::{Artifact, Description, Geometry, Mode, MontageFile};
use std::path::{Path, PathBuf};

/// Options of `trainer train`.
#[derive(Clone, Debug)]
pub struct TrainOptions {
    /// Folder that holds all recordings.
    pub data: PathBuf,
    /// Names or ranges of the training recordings.
    pub train: Vec<String>,
    /// Names or ranges of the test recordings.
    pub test: Vec<String>,
    /// Grid, order of the ADC's channels and ADC.
    pub montage: MontageFile,
    /// Mode and dimensions of the model.
    pub shape: card::Shape,
    /// Mains frequency of the recordings, Hz.
    pub mains_hz: u32,
    /// Origin and licence of the recordings, for the training card.
    pub dataset: String,
    /// References to cite, for the training card.
    pub citation: String,
    /// Epochs, batch size, learning rate and seed, which determine the trained model.
    pub settings: Settings,
    /// File that stores the training run after each epoch.
    pub checkpoint: PathBuf,
    /// True to continue the training run stored in `checkpoint`.
    pub resume: bool,
    /// Folder to write the artifact to.
    pub out: PathBuf,
    /// True to replace an artifact in `out`.
    pub force: bool,
}

/// Receives the progress of a training run or an evaluation.
pub trait ProgressObserver {
    /// Reports a message for the user, one line.
    fn message(&mut self, text: &str);
    /// Reports the start of epoch `epoch` of `epochs`, which has `batches` batches.
    fn epoch_started(&mut self, epoch: u32, epochs: u32, batches: usize);
    /// Reports the number of batches finished in this epoch, and the loss of the last batch.
    fn batch_finished(&mut self, batches: usize, loss: f64);
    /// Reports that an epoch is finished, with its losses.
    fn epoch_finished(&mut self, report: EpochReport);
}

/// Figures of a model, and of PCA with the same number of components, on the same test recordings.
#[derive(Clone, Copy, Debug)]
pub struct Comparison {
    /// Figures of the model that was trained or read.
    pub network: Evaluation,
    /// Figures of PCA, fitted to the training part of the training recordings.
    pub pca: Evaluation,
    /// Number of numbers in a code.
    pub numbers: usize,
    /// Whether the model is itself the PCA.
    pub is_pca: bool,
}

/// Recordings after the front end, scaled and split for training.
struct PreparedData {
    files: Vec<String>,
    split: Split,
    /// Complete tracks, for calibration.
    whole: Dataset,
    sd_uv: f64,
    interpolated: Vec<String>,
}

/// Trains a model, calibrates and evaluates it, and writes its artifact and golden windows.
///
/// # Errors
/// If recordings cannot be used, training diverges or files cannot be written.
pub fn train(
    options: &TrainOptions,
    observer: &mut impl ProgressObserver,
) -> Result<Comparison, TrainerError> {
    // Before the training, which takes hours.
    if !options.force && options.out.join("model.toml").exists() {
        let folder = options.out.clone();
        return Err(TrainerError::ArtifactExists { folder });
    }
    let mut description = card::checked_description(&options.montage, options.shape)?;
    let train_files = selection::recordings(&options.data, &options.train)?;
    let test_files = selection::recordings(&options.data, &options.test)?;
    if let Some(both) = test_files.iter().find(|file| train_files.contains(file)) {
        return Err(TrainerError::TrainedOn {
            name: file_name(both),
        });
    }
    let data = PreparedData::read(&train_files, &description, options.mains_hz, observer)?;
    description.input.sd_uv = data.sd_uv;
    observer.message("computing the principal directions of the training windows ...");
    let geometry = Geometry::new(&description);
    let directions = data.directions(geometry.dimensions.numbers);
    let pca = Parameters::pca(geometry, &directions);
    fill_card(&mut description, options, &data);
    let best = if description.mode == Mode::Pca {
        pca.clone()
    } else {
        train_network(options, &mut description, &data, &directions, observer)?
    };
    description.training.test_files = test_files.iter().map(|file| file_name(file)).collect();
    let mut model = calibrated_artifact(description.clone(), &best, &data.whole)?;
    let pca = calibrated_artifact(description, &pca, &data.whole)?;
    let test = read_test(&test_files, &model, options.mains_hz, observer)?;
    observer.message("evaluating on the test recordings ...");
    let comparison = Comparison {
        network: evaluate(&model, &test)?,
        pca: evaluate(&pca, &test)?,
        numbers: geometry.dimensions.numbers,
        is_pca: model.description.mode == Mode::Pca,
    };
    let Comparison { network, pca, .. } = &comparison;
    let card = &mut model.description.training;
    card.mse = Some(card::figures(network, pca, |error| error.mse));
    card.prd_percent = Some(card::figures(network, pca, |error| error.prd_percent));
    let id = model.write(&options.out)?;
    golden_windows(&model_gen::quantise(&model)?).write(&options.out)?;
    observer.message(&format!("model {id} written to {}", options.out.display()));
    Ok(comparison)
}

/// Evaluates the artifact in `folder` on recordings in `data`, and PCA fitted to the artifact's training
/// recordings. `test` names the test recordings; if it is empty, those of the training card are used.
///
/// # Errors
/// If the artifact or a recording cannot be used.
pub fn compare(
    folder: &Path,
    data: &Path,
    test: &[String],
    observer: &mut impl ProgressObserver,
) -> Result<Comparison, TrainerError> {
    let model = Artifact::read(folder)?;
    let card = &model.description.training;
    let test = if test.is_empty() {
        &card.test_files
    } else {
        test
    };
    let test_files = selection::recordings(data, test)?;
    let train_files = selection::recordings(data, &card.train_files)?;
    if let Some(both) = test_files.iter().find(|file| train_files.contains(file)) {
        return Err(TrainerError::TrainedOn {
            name: file_name(both),
        });
    }
    let data = PreparedData::read(&train_files, &model.description, card.mains_hz, observer)?;
    let mut description = model.description.clone();
    let geometry = Geometry::new(&description);
    let pca = Parameters::pca(geometry, &data.directions(geometry.dimensions.numbers));
    description.input.sd_uv = data.sd_uv;
    let pca = calibrated_artifact(description, &pca, &data.whole)?;
    let test_network = read_test(&test_files, &model, card.mains_hz, observer)?;
    let test_pca = read_test(&test_files, &pca, card.mains_hz, observer)?;
    Ok(Comparison {
        network: evaluate(&model, &test_network)?,
        pca: evaluate(&pca, &test_pca)?,
        numbers: geometry.dimensions.numbers,
        is_pca: model.description.mode == Mode::Pca,
    })
}

/// Runs the remaining epochs of a training run and writes a checkpoint after each epoch.
fn run_epochs(
    options: &TrainOptions,
    data: &PreparedData,
    network: &Network,
    (description, directions): (&Description, &[Vec<f32>]),
    observer: &mut impl ProgressObserver,
) -> Result<Training, TrainerError> {
    let TrainOptions {
        settings,
        checkpoint: path,
        ..
    } = options;
    let split = &data.split;
    let card::Shape {
        mode,
        numbers,
        steps,
        hop,
        padding,
    } = options.shape;
    let data_identity = format!(
        "{} with SD {} uV; montage {}, mode {mode}, {numbers} numbers, windows of {steps} steps, hop {hop}, \
         padding {padding}",
        data.files.join(" "),
        data.sd_uv,
        options.montage.name
    );
    let mut training = if options.resume {
        let training = checkpoint::read(path, description, *settings, &data_identity)?;
        observer.message(&format!("resumed after epoch {}", training.epoch()));
        training
    } else {
        let geometry = Geometry::new(description);
        let start = if description.mode.has_shortcut() {
            Parameters::from_directions(geometry, directions, settings.seed)
        } else {
            Parameters::random(description.mode, geometry, settings.seed)
        };
        Training::start(*settings, start, network, split)
    };
    observer.message(&format!(
        "epoch 0 (PCA): validation MSE {:.5}",
        training.best().validation
    ));
    while !training.is_done() {
        let batches = training.batches(split);
        observer.epoch_started(training.epoch() + 1, settings.epochs, batches);
        let report = training.run_epoch(network, split, |done, loss| {
            observer.batch_finished(done, loss);
        })?;
        observer.epoch_finished(report);
        checkpoint::write(path, &training, &data_identity)?;
    }
    Ok(training)
}

/// Fills the training card, except for the test files and figures.
fn fill_card(description: &mut Description, options: &TrainOptions, data: &PreparedData) {
    let card = &mut description.training;
    card.dataset.clone_from(&options.dataset);
    card.citation.clone_from(&options.citation);
    card.interpolated.clone_from(&data.interpolated);
    card.interpolated_electrodes = card.interpolated.len();
    card.real_electrodes = description.montage.electrodes.len() - card.interpolated_electrodes;
    card.note = card::note(card.real_electrodes, card.interpolated_electrodes);
    card.train_files.clone_from(&data.files);
    card.validation = format!(
        "last eighth of every training file; the first {SETTLING_S} s of every file are left out"
    );
    card.mains_hz = options.mains_hz;
    card.seed = options.settings.seed;
    "none: principal directions of the training part".clone_into(&mut card.optimiser);
}

/// Trains a network from its initial parameters, completes the training card, and returns the
/// parameters of the best epoch.
fn train_network(
    options: &TrainOptions,
    description: &mut Description,
    data: &PreparedData,
    directions: &[Vec<f32>],
    observer: &mut impl ProgressObserver,
) -> Result<Parameters, TrainerError> {
    let network = Network::new(description);
    let training = run_epochs(options, data, &network, (description, directions), observer)?;
    let best = training.best();
    observer.message(&format!(
        "best epoch: {}, validation MSE {:.5}",
        best.epoch, best.validation
    ));
    let Settings {
        epochs,
        batch,
        peak_rate,
        ..
    } = options.settings;
    let card = &mut description.training;
    card.epochs = epochs;
    card.best_epoch = best.epoch;
    card.windows = (training.batches(&data.split) * batch) as u64;
    let (start, shortcut) = if description.mode.has_shortcut() {
        (
            "PCA start, convolutions silent at first",
            " (shortcut a hundredth)",
        )
    } else {
        ("random start", "")
    };
    card.optimiser = format!(
        "{start}; Adam, one cycle with peak {peak_rate}{shortcut}, 15 % warm-up, batch {batch}"
    );
    Ok(best.parameters.clone())
}

/// Passes recordings through the front end, and reports the length and the warnings of each recording.
fn read_tracks(
    files: &[PathBuf],
    description: &Description,
    mains_hz: u32,
    observer: &mut impl ProgressObserver,
) -> Result<Vec<Track>, TrainerError> {
    files
        .iter()
        .map(|file| {
            let track = Track::read(file, description, mains_hz)?;
            observer.message(&format!(
                "{}: {} time steps, {} electrodes interpolated, {} counts at the rail",
                track.name,
                track.steps(),
                track.interpolated.len(),
                track.saturated
            ));
            for warning in &track.warnings {
                observer.message(&format!("{}: warning: {warning}", track.name));
            }
            Ok(track)
        })
        .collect()
}

/// Passes the test recordings through the front end, and scales them to the input unit of `model`.
fn read_test(
    files: &[PathBuf],
    model: &Artifact,
    mains_hz: u32,
    observer: &mut impl ProgressObserver,
) -> Result<Dataset, TrainerError> {
    let tracks = read_tracks(files, &model.description, mains_hz, observer)?;
    let mut test = Dataset::from_tracks(&tracks, model.description.dimensions())?;
    test.scale(1.0 / model.description.input.sd_uv);
    Ok(test)
}

impl PreparedData {
    /// Passes recordings through the front end, and scales them to a standard deviation of 1 over the
    /// training part.
    fn read(
        files: &[PathBuf],
        description: &Description,
        mains_hz: u32,
        observer: &mut impl ProgressObserver,
    ) -> Result<Self, TrainerError> {
        let tracks = read_tracks(files, description, mains_hz, observer)?;
        let mut split = Dataset::split(&tracks, description.dimensions())?;
        let mut whole = Dataset::from_tracks(&tracks, description.dimensions())?;
        let sd_uv = split.training.deviation();
        if sd_uv <= 0.0 {
            return Err(TrainerError::Silent);
        }
        for part in [&mut split.training, &mut split.validation, &mut whole] {
            part.scale(1.0 / sd_uv);
        }
        let electrodes = &description.montage.electrodes;
        let is_interpolated =
            |label: &&String| tracks.iter().any(|t| t.interpolated.contains(label));
        let interpolated = electrodes.iter().filter(is_interpolated).cloned().collect();
        let files = tracks.into_iter().map(|track| track.name).collect();
        observer.message(&format!(
            "standard deviation of the training part: {sd_uv:.2} uV"
        ));
        Ok(Self {
            files,
            split,
            whole,
            sd_uv,
            interpolated,
        })
    }

    /// Returns the `count` principal directions of the training part.
    fn directions(&self, count: usize) -> Vec<Vec<f32>> {
        pca::principal_directions(pca::second_moment(&self.split.training), count)
    }
}
