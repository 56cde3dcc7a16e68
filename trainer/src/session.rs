//! The command `trainer train`: trains a model from recordings.

use crate::calibrate::calibrated_artifact;
use crate::card::ModelOptions;
use crate::comparison::Comparison;
use crate::dataset::{Split, TrainingSet};
use crate::error::TrainerError;
use crate::golden::golden_windows;
use crate::network::Network;
use crate::parameters::Parameters;
use crate::people::People;
use crate::progress::ProgressObserver;
use crate::selection::{Selected, TrainingFiles, check_writable, refuse_model};
use crate::training::{Learning, Settings, Training, validation_windows};
use crate::{card, checkpoint, report};
use artifact::{Artifact, Description, Geometry, Mode, Pca, TestedPerson};
use packed_fit::settling_steps;
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Options of `trainer train`.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct TrainOptions {
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
    /// File in which the training run is saved after each epoch.
    #[arg(long, default_value = "target/trainer/checkpoint.safetensors")]
    checkpoint: PathBuf,
    /// Resume the training run from the checkpoint.
    #[arg(long)]
    resume: bool,
    /// Folder to write the artifact to.
    #[arg(long)]
    out: PathBuf,
    /// Folder to write a report to: learning curves and error of each electrode, as pictures with
    /// their values and a page that shows them.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace an artifact in the folder of --out, and a report in the folder of --report.
    #[arg(long)]
    force: bool,
}

/// Trains a model, calibrates and evaluates it, and writes its artifact, golden windows and PCA,
/// and a report if the options name a folder for it. Returns the comparison on the test recordings;
/// `None` without test recordings.
///
/// # Errors
/// If recordings cannot be used, training diverges, the user interrupts it or files cannot be
/// written.
pub(crate) fn train(
    options: &TrainOptions,
    observer: &mut impl ProgressObserver,
) -> Result<Option<Comparison>, TrainerError> {
    // Make all checks before training, which can take hours.
    let montage = options.model.montage()?;
    refuse_model(&options.out, options.force)?;
    let mut description = card::checked_description(&montage, options.model.shape)?;
    let selected = options.files.find()?;
    if options.report.is_some() && selected.test.is_empty() && description.mode == Mode::Pca {
        return Err(TrainerError::NothingToReport);
    }
    report::prepare(options.report.as_deref(), options.force)?;
    check_writable(&options.out)?;
    if let (true, Some(folder)) = (description.mode.has_convolutions(), options.checkpoint.parent())
    {
        check_writable(folder)?;
    }
    let people = People::read(&selected.train, &options.files, &description, observer)?;
    let scaled = people.at_equal_power(observer);
    let training_set = TrainingSet::new(&scaled, &people.tracks, description.dimensions())?;
    let electrodes = &description.montage.electrodes;
    card::fill_electrodes(&mut description.training, electrodes, &people.tracks);
    description.training.people = people.card();
    drop((people, scaled));
    let sd_uv = training_set.sd_uv;
    description.input.sd_uv = sd_uv;
    observer.message(&format!("standard deviation of the training part: {sd_uv:.2} uV"));
    observer.message("computing the principal directions of the training windows ...");
    let geometry = Geometry::new(&description);
    let directions = training_set.directions();
    let initial = |mode| Parameters::initial(mode, geometry, &directions, options.settings.seed);
    let pca = initial(Mode::Pca);
    fill_card(&mut description, options, &selected)?;
    let (best, learning) = if description.mode == Mode::Pca {
        (pca.clone(), None)
    } else {
        let data = format!(
            "{} with SD {sd_uv} uV; montage {}, {}",
            description.training.train_files.join(" "),
            montage.name,
            options.model.shape
        );
        let split = &training_set.split;
        let start = initial(description.mode);
        let training = train_network(options, &mut description, (split, &data), start, observer)?;
        let network = Network::new(&description);
        let learning = Learning {
            curve: training.curve,
            best_epoch: training.best.epoch,
            pca_validation: network.mean_squared_error(&pca, &validation_windows(split)),
        };
        (training.best.parameters, Some(learning))
    };
    let whole = &training_set.whole;
    let mut model = calibrated_artifact(description.clone(), &best, whole)?;
    let pca = Pca::from_model(&calibrated_artifact(description, &pca, whole)?)?;
    let comparison = if selected.test.is_empty() {
        observer.message("no test recordings: the training card has no figures");
        None
    } else {
        let people = People::read(&selected.test, &options.files, &model.description, observer)?;
        observer.message("evaluating on the test recordings ...");
        model.description.training.tested = test_each(&model, &pca, &people, observer)?;
        Some(Comparison::new(&model, Some(&pca), &people.tracks, None)?)
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
    let comparison =
        comparison.map(|comparison| Comparison { model: id.to_string(), ..comparison });
    if let Some(folder) = &options.report {
        let (learning, comparison) = (learning.as_ref(), comparison.as_ref());
        report::write(folder, "Training of a model", learning, comparison)?;
        observer.message(&report::message(folder));
    }
    Ok(comparison)
}

/// Returns and reports the error on each person's test recordings; empty for fewer than two people.
fn test_each(
    model: &Artifact,
    pca: &Pca,
    people: &People,
    observer: &mut impl ProgressObserver,
) -> Result<Vec<TestedPerson>, TrainerError> {
    let mut tested = Vec::new();
    if people.count() < 2 {
        return Ok(tested);
    }
    for (person, tracks) in people.each() {
        let comparison = Comparison::new(model, Some(pca), &tracks, None)?;
        let Some(prd_percent) = comparison.figures(|error| error.prd_percent) else {
            continue;
        };
        observer.message(&format!(
            "{}: PRD of integer codes {:.2} %, of PCA's {:.2} %",
            person.subject, prd_percent.autoencoder_int8, prd_percent.pca_int8
        ));
        tested.push(TestedPerson {
            subject: person.subject.clone(),
            bad: person.bad.clone(),
            prd_percent,
        });
    }
    Ok(tested)
}

/// Runs the remaining epochs of a training run, and writes a checkpoint after each epoch. The run
/// starts with the parameters `start` or continues from its checkpoint. In the checkpoint, the text
/// `data` identifies the data in `split`.
fn run_epochs(
    options: &TrainOptions,
    (split, data): (&Split, &str),
    description: &Description,
    start: Parameters,
    observer: &mut impl ProgressObserver,
) -> Result<Training, TrainerError> {
    let (settings, path) = (&options.settings, &options.checkpoint);
    let network = &Network::new(description);
    let mut training = if options.resume {
        let training = checkpoint::read(path, description, *settings, data)?;
        observer.message(&format!(
            "resumed after epoch {}; best validation MSE so far {:.5}",
            training.epoch, training.best.validation
        ));
        training
    } else {
        let training = Training::start(*settings, start, network, split);
        let is_pca = if description.mode.has_shortcut() { " (PCA)" } else { "" };
        observer
            .message(&format!("epoch 0{is_pca}: validation MSE {:.5}", training.best.validation));
        training
    };
    while !training.is_done() {
        let (epoch, batches) = (training.epoch + 1, training.batches(split));
        observer.epoch_started(epoch, settings.epochs, batches, settings.batch);
        let losses = training.run_epoch(network, split, |loss| {
            observer.batch_finished(loss);
            if observer.is_interrupted() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        let losses = losses.map_err(|error| match error {
            TrainerError::Interrupted(epochs, _) => TrainerError::Interrupted(epochs, path.clone()),
            other => other,
        })?;
        observer.epoch_finished(epoch, losses);
        checkpoint::write(path, &training, data)?;
    }
    Ok(training)
}

/// Fills in the training card, except for its entries on electrodes and figures.
fn fill_card(
    description: &mut Description,
    options: &TrainOptions,
    selected: &Selected,
) -> Result<(), TrainerError> {
    let mains_hz = options.files.mains_hz;
    let settling = settling_steps(description, mains_hz)?;
    let card = &mut description.training;
    card.dataset.clone_from(&options.dataset);
    card.citation.clone_from(&options.citation);
    [card.train_files, card.test_files] = selected.names();
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

/// Runs the epochs of a training run as [`run_epochs`] does, and records its results on the
/// training card.
fn train_network(
    options: &TrainOptions,
    description: &mut Description,
    (split, data): (&Split, &str),
    start: Parameters,
    observer: &mut impl ProgressObserver,
) -> Result<Training, TrainerError> {
    let training = run_epochs(options, (split, data), description, start, observer)?;
    let best = &training.best;
    observer.message(&format!("best epoch: {}, validation MSE {:.5}", best.epoch, best.validation));
    let silent = best.parameters.clone().hold_silent_channels();
    if silent > 0 {
        observer.message(&format!(
            "{silent} channels of the convolutions never vary and are held constant; a lower --learning-rate may \
             keep them alive"
        ));
    }
    let Settings { epochs, batch, peak_rate, .. } = options.settings;
    let card = &mut description.training;
    card.epochs = epochs;
    card.best_epoch = best.epoch;
    card.windows = (training.batches(split) * batch) as u64;
    let (start, shortcut) = if description.mode.has_shortcut() {
        ("PCA start, convolutions silent at first", " (shortcut a hundredth)")
    } else {
        ("random start", "")
    };
    card.optimiser = format!(
        "{start}; Adam, one cycle with peak {peak_rate}{shortcut}, 15 % warm-up, batch {batch}"
    );
    Ok(training)
}
