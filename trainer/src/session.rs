//! Trains a model from recordings.

use crate::calibrate::calibrated_artifact;
use crate::card::{ModelOptions, Shape};
use crate::comparison::Comparison;
use crate::dataset::{Dataset, Split};
use crate::error::TrainerError;
use crate::golden::golden_windows;
use crate::learning_curve::Learning;
use crate::network::Network;
use crate::output::{check_writable, refuse_model};
use crate::parameters::Parameters;
use crate::progress::ProgressObserver;
use crate::selection::{Selected, TrainingFiles};
use crate::track::settling_steps;
use crate::training::{Settings, Training, validation_windows};
use crate::{card, checkpoint, pca, report};
use artifact::{Description, Geometry, Mode, MontageFile, Pca};
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Options of `trainer train`.
#[derive(clap::Args, Clone, Debug)]
pub struct TrainOptions {
    #[command(flatten)]
    files: TrainingFiles,
    #[command(flatten)]
    model: ModelOptions,
    #[command(flatten)]
    settings: Settings,
    /// Origin and licence of the recordings, for the training card.
    #[arg(long, default_value = "not stated")]
    dataset: String,
    /// References to cite, for the training card.
    #[arg(long, default_value = "not stated")]
    citation: String,
    /// File that stores the training run after each epoch.
    #[arg(long, default_value = "target/trainer/checkpoint.safetensors")]
    checkpoint: PathBuf,
    /// Resume the training run from the checkpoint.
    #[arg(long)]
    resume: bool,
    /// Folder to write the artifact to.
    #[arg(long)]
    out: PathBuf,
    /// Folder to write a report to: learning curves, error of each electrode, rate and error, as
    /// pictures with their values and a page that shows them.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace an artifact in the folder of --out, and a report in that of --report.
    #[arg(long)]
    force: bool,
}

/// Recordings after the front end, scaled and split for training.
struct PreparedData {
    files: Vec<String>,
    split: Split,
    /// Complete tracks, for calibration.
    whole: Dataset,
    sd_uv: f64,
}

/// Trains a model, calibrates and evaluates it, and writes its artifact, golden windows and PCA,
/// and its report if the options name a folder for it. Returns the comparison on the test
/// recordings; `None` if there are none.
///
/// # Errors
/// If recordings cannot be used, training diverges, the user interrupts it or files cannot be
/// written.
pub fn train(
    options: &TrainOptions,
    observer: &mut impl ProgressObserver,
) -> Result<Option<Comparison>, TrainerError> {
    // All checks come before the training, which takes hours.
    let montage = options.model.montage()?;
    refuse_model(&options.out, options.force)?;
    let mut description = card::checked_description(&montage, options.model.shape)?;
    let selected = options.files.find()?;
    if options.report.is_some() && selected.test.is_empty() && description.mode == Mode::Pca {
        return Err(TrainerError::NothingToReport);
    }
    report::prepare(options.report.as_deref(), options.force)?;
    check_writable(&options.out)?;
    if let (true, Some(folder)) = (
        description.mode.has_convolutions(),
        options.checkpoint.parent(),
    ) {
        check_writable(folder)?;
    }
    let data = PreparedData::read(&selected, &mut description, observer)?;
    observer.message("computing the principal directions of the training windows ...");
    let geometry = Geometry::new(&description);
    let directions = data.directions(geometry.dimensions.numbers);
    let pca = Parameters::pca(geometry, &directions);
    fill_card(&mut description, options, &data)?;
    let (best, learning) = if description.mode == Mode::Pca {
        (pca.clone(), None)
    } else {
        let identity = data.identity(&montage, options.model.shape);
        let start = Parameters::initial(
            description.mode,
            geometry,
            &directions,
            options.settings.seed,
        );
        let training = train_network(
            options,
            &mut description,
            (&data, &identity),
            start,
            observer,
        )?;
        let network = Network::new(&description);
        let validation = validation_windows(&data.split);
        let learning = Learning {
            curve: training.curve().clone(),
            best_epoch: training.best().epoch,
            pca_validation: network.mean_squared_error(&pca, &validation),
        };
        (training.best().parameters.clone(), Some(learning))
    };
    [_, description.training.test_files] = selected.names();
    let mut model = calibrated_artifact(description.clone(), &best, &data.whole)?;
    let pca = Pca::from_model(&calibrated_artifact(description, &pca, &data.whole)?)?;
    let comparison = if selected.test.is_empty() {
        observer.message("no test recordings: the training card has no figures");
        None
    } else {
        let tracks = selected.read(&selected.test, &model.description, observer)?;
        observer.message("evaluating on the test recordings ...");
        Some(Comparison::new(&model, Some(&pca), &tracks)?)
    };
    let figures = comparison.as_ref();
    let card = &mut model.description.training;
    card.mse = figures.and_then(|comparison| comparison.figures(|error| error.mse));
    card.prd_percent = figures.and_then(|comparison| comparison.figures(|error| error.prd_percent));
    let id = model.write(&options.out)?;
    golden_windows(&model_gen::quantise(&model)?).write(&options.out)?;
    if model.description.mode != Mode::Pca {
        pca.write(&options.out)?;
    }
    observer.message(&format!("model {id} written to {}", options.out.display()));
    let comparison = comparison.map(|comparison| Comparison {
        model: id.to_string(),
        ..comparison
    });
    if let Some(folder) = &options.report {
        report::write_training(folder, learning.as_ref(), comparison.as_ref())?;
        observer.message(&report::message(folder));
    }
    Ok(comparison)
}

/// Runs the remaining epochs of a training run from `start`, or from its checkpoint, and writes a
/// checkpoint after each epoch.
fn run_epochs(
    options: &TrainOptions,
    (data, identity): (&PreparedData, &str),
    description: &Description,
    start: Parameters,
    observer: &mut impl ProgressObserver,
) -> Result<Training, TrainerError> {
    let (settings, path) = (&options.settings, &options.checkpoint);
    let split = &data.split;
    let network = &Network::new(description);
    let mut training = if options.resume {
        let training = checkpoint::read(path, description, *settings, identity)?;
        observer.message(&format!(
            "resumed after epoch {}; best validation MSE so far {:.5}",
            training.epoch(),
            training.best().validation
        ));
        training
    } else {
        let training = Training::start(*settings, start, network, split);
        let is_pca = if description.mode.has_shortcut() {
            " (PCA)"
        } else {
            ""
        };
        observer.message(&format!(
            "epoch 0{is_pca}: validation MSE {:.5}",
            training.best().validation
        ));
        training
    };
    while !training.is_done() {
        let (epoch, batches) = (training.epoch() + 1, training.batches(split));
        observer.epoch_started(epoch, settings.epochs, batches, settings.batch);
        let report = training.run_epoch(network, split, |loss| {
            observer.batch_finished(loss);
            if observer.is_interrupted() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        let report = report.map_err(|error| match error {
            TrainerError::Interrupted(epochs, _) => TrainerError::Interrupted(epochs, path.clone()),
            other => other,
        })?;
        observer.epoch_finished(report);
        checkpoint::write(path, &training, identity)?;
    }
    Ok(training)
}

/// Fills the training card, except for the test files and figures.
fn fill_card(
    description: &mut Description,
    options: &TrainOptions,
    data: &PreparedData,
) -> Result<(), TrainerError> {
    let mains_hz = options.files.mains_hz;
    let settling = settling_steps(description, mains_hz)?;
    let card = &mut description.training;
    card.dataset.clone_from(&options.dataset);
    card.citation.clone_from(&options.citation);
    card.train_files.clone_from(&data.files);
    card.validation = card::validation(
        Some("last eighth of every training file"),
        settling,
        description.window.rate_hz,
    );
    card.mains_hz = mains_hz;
    card.seed = options.settings.seed;
    "none: principal directions of the training part".clone_into(&mut card.optimiser);
    Ok(())
}

/// Trains a network from its initial parameters, and completes the training card. `data` comes with
/// its identity.
fn train_network(
    options: &TrainOptions,
    description: &mut Description,
    data: (&PreparedData, &str),
    start: Parameters,
    observer: &mut impl ProgressObserver,
) -> Result<Training, TrainerError> {
    let training = run_epochs(options, data, description, start, observer)?;
    let best = training.best();
    observer.message(&format!(
        "best epoch: {}, validation MSE {:.5}",
        best.epoch, best.validation
    ));
    let silent = best.parameters.clone().hold_silent_channels();
    if silent > 0 {
        observer.message(&format!(
            "{silent} channels of the convolutions never vary and are held constant; a lower --learning-rate may \
             keep them alive"
        ));
    }
    let Settings {
        epochs,
        batch,
        peak_rate,
        ..
    } = options.settings;
    let card = &mut description.training;
    card.epochs = epochs;
    card.best_epoch = best.epoch;
    card.windows = (training.batches(&data.0.split) * batch) as u64;
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
    Ok(training)
}

impl PreparedData {
    /// Passes recordings through the front end, and scales them to a standard deviation of 1 over
    /// the training part. Fills in `input.sd_uv`, and the electrodes of the training card.
    fn read(
        selected: &Selected,
        description: &mut Description,
        observer: &mut impl ProgressObserver,
    ) -> Result<Self, TrainerError> {
        let tracks = selected.read(&selected.train, description, observer)?;
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
        card::fill_electrodes(&mut description.training, electrodes, &tracks);
        let [files, _] = selected.names();
        description.input.sd_uv = sd_uv;
        observer.message(&format!(
            "standard deviation of the training part: {sd_uv:.2} uV"
        ));
        Ok(Self {
            files,
            split,
            whole,
            sd_uv,
        })
    }

    /// Returns data and shape of the model as text; a checkpoint of other data or another shape is
    /// refused.
    fn identity(&self, montage: &MontageFile, shape: Shape) -> String {
        let Shape {
            mode,
            numbers,
            steps,
            hop,
            padding,
            format: _,
        } = shape;
        format!(
            "{} with SD {} uV; montage {}, mode {mode}, {numbers} numbers, windows of {steps} steps, \
             hop {hop}, padding {padding}",
            self.files.join(" "),
            self.sd_uv,
            montage.name
        )
    }

    /// Returns the `count` principal directions of the training part.
    fn directions(&self, count: usize) -> Vec<Vec<f32>> {
        pca::principal_directions(pca::second_moment(&self.split.training), count)
    }
}
