//! From recordings to an artifact, and from an artifact to its figures.

use crate::dataset::{Dataset, Split};
use crate::error::TrainerError;
use crate::evaluate::{Evaluation, evaluate};
use crate::network::Network;
use crate::parameters::Parameters;
use crate::selection::file_name;
use crate::track::{SETTLING_S, Track};
use crate::training::{EpochReport, Settings, Training};
use crate::{calibrate, card, checkpoint, golden, pca, selection};
use artifact::{Artifact, CODE, Description, ScalpGrid};
use std::path::{Path, PathBuf};

/// What `trainer train` is asked for.
#[derive(Clone, Debug)]
pub struct Order {
    /// Folder of the recordings.
    pub data: PathBuf,
    /// Names of the recordings to train on.
    pub train: Vec<String>,
    /// Names of the recordings to test with.
    pub test: Vec<String>,
    /// Mains frequency where they were made, Hz.
    pub mains_hz: u32,
    /// Origin and licence of the recordings, for the card.
    pub dataset: String,
    /// What to cite, for the card.
    pub citation: String,
    /// How to train.
    pub settings: Settings,
    /// Where the training is kept between epochs.
    pub checkpoint: PathBuf,
    /// Whether to go on from there.
    pub resume: bool,
    /// Folder of the artifact.
    pub out: PathBuf,
}

/// What a person who waits wants to see.
pub trait Audience {
    /// Something worth a line happened.
    fn line(&mut self, text: &str);
    /// An epoch begins.
    fn epoch_begins(&mut self, epoch: u32, of: u32, batches: usize);
    /// Batches done in this epoch, and the last loss.
    fn batch_done(&mut self, batches: usize, loss: f64);
    /// An epoch ended.
    fn epoch_ends(&mut self, report: EpochReport);
}

/// The figures of a model and of PCA with as many components.
#[derive(Clone, Copy, Debug)]
pub struct Comparison {
    /// The model.
    pub network: Evaluation,
    /// PCA, fitted to the training part of the same recordings.
    pub pca: Evaluation,
}

/// Recordings behind the front end, ready to train on.
struct Material {
    files: Vec<String>,
    split: Split,
    /// Training and validation part together, for calibration.
    whole: Dataset,
    sd_uv: f64,
    interpolated: Vec<String>,
}

/// Trains a model, calibrates and measures it and writes its folder.
///
/// # Errors
/// When recordings cannot be used, training diverges or files cannot be written.
pub fn train(order: &Order, audience: &mut impl Audience) -> Result<Comparison, TrainerError> {
    let mut description = card::description();
    let train_files = selection::recordings(&order.data, &order.train)?;
    let test_files = selection::recordings(&order.data, &order.test)?;
    if let Some(both) = test_files.iter().find(|file| train_files.contains(file)) {
        return Err(TrainerError::TrainedOn {
            name: file_name(both),
        });
    }
    let material = Material::read(&train_files, &description, order.mains_hz, audience)?;
    description.input.sd_uv = material.sd_uv;
    audience.line("principal directions of the training windows ...");
    let directions = material.directions();
    let grid = ScalpGrid::new(&description);
    let network = Network::new(grid);
    let training = run_epochs(order, &material, &network, &directions, audience)?;
    let best = training.best();
    audience.line(&format!(
        "best epoch: {}, validation MSE {:.5}",
        best.epoch, best.validation
    ));

    fill_card(&mut description, order, &material, &training);
    description.training.test_files = test_files.iter().map(|file| file_name(file)).collect();
    let mut model = calibrate::artifact(description.clone(), &best.parameters, &material.whole)?;
    let pca = Parameters::pca(&directions);
    let pca = calibrate::artifact(description, &pca, &material.whole)?;
    let test = read_test(&test_files, &model, order.mains_hz, audience)?;
    audience.line("measuring on the test recordings ...");
    let comparison = Comparison {
        network: evaluate(&model, &test)?,
        pca: evaluate(&pca, &test)?,
    };
    let Comparison { network, pca } = &comparison;
    let card = &mut model.description.training;
    card.mse = Some(card::figures(network, pca, |merit| merit.mse));
    card.prd_percent = Some(card::figures(network, pca, |merit| merit.prd_percent));
    let id = model.write(&order.out)?;
    golden::golden(&model_gen::quantise(&model)?).write(&order.out)?;
    audience.line(&format!("model {id} written to {}", order.out.display()));
    Ok(comparison)
}

/// Measures the artifact in `folder` on recordings in `data`, beside PCA fitted to the recordings
/// that its card says it was trained on. `test`: other recordings than the card's.
///
/// # Errors
/// When the artifact or a recording cannot be used.
pub fn compare(
    folder: &Path,
    data: &Path,
    test: &[String],
    audience: &mut impl Audience,
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
    let material = Material::read(&train_files, &model.description, card.mains_hz, audience)?;
    let pca = Parameters::pca(&material.directions());
    let mut description = model.description.clone();
    description.input.sd_uv = material.sd_uv;
    let pca = calibrate::artifact(description, &pca, &material.whole)?;
    let of_network = read_test(&test_files, &model, card.mains_hz, audience)?;
    let of_pca = read_test(&test_files, &pca, card.mains_hz, audience)?;
    Ok(Comparison {
        network: evaluate(&model, &of_network)?,
        pca: evaluate(&pca, &of_pca)?,
    })
}

fn run_epochs(
    order: &Order,
    material: &Material,
    network: &Network,
    directions: &[Vec<f32>],
    audience: &mut impl Audience,
) -> Result<Training, TrainerError> {
    let Order {
        settings,
        checkpoint: path,
        ..
    } = order;
    let split = &material.split;
    let data = format!(
        "{} with SD {:?} uV",
        material.files.join(" "),
        material.sd_uv
    );
    let mut training = if order.resume {
        let training = checkpoint::read(path, *settings, &data)?;
        audience.line(&format!("goes on after epoch {}", training.epoch()));
        training
    } else {
        let start = Parameters::from_directions(directions, settings.seed);
        Training::start(*settings, start, network, split)
    };
    audience.line(&format!(
        "epoch 0 (PCA): validation MSE {:.5}",
        training.best().validation
    ));
    while !training.is_done() {
        let batches = training.batches(split);
        audience.epoch_begins(training.epoch() + 1, settings.epochs, batches);
        let report =
            training.run_epoch(network, split, |done, loss| audience.batch_done(done, loss))?;
        audience.epoch_ends(report);
        checkpoint::write(path, &training, &data)?;
    }
    Ok(training)
}

fn fill_card(
    description: &mut Description,
    order: &Order,
    material: &Material,
    training: &Training,
) {
    let Settings {
        epochs,
        batch,
        peak_rate,
        seed,
    } = order.settings;
    let card = &mut description.training;
    card.dataset.clone_from(&order.dataset);
    card.citation.clone_from(&order.citation);
    card.interpolated.clone_from(&material.interpolated);
    card.interpolated_electrodes = card.interpolated.len();
    card.real_electrodes = description.montage.electrodes.len() - card.interpolated_electrodes;
    card.note = card::note(card.real_electrodes, card.interpolated_electrodes);
    card.train_files.clone_from(&material.files);
    card.validation = format!(
        "last eighth of every training file; the first {SETTLING_S} s of every file are left out"
    );
    card.mains_hz = order.mains_hz;
    card.seed = seed;
    card.epochs = epochs;
    card.best_epoch = training.best().epoch;
    card.windows = (training.batches(&material.split) * batch) as u64;
    card.optimiser = format!(
        "PCA start, convolutions silent at first; Adam, one cycle with peak {peak_rate} (shortcut \
         a hundredth), 15 % warm-up, batch {batch}"
    );
}

fn read_tracks(
    files: &[PathBuf],
    description: &Description,
    mains_hz: u32,
    audience: &mut impl Audience,
) -> Result<Vec<Track>, TrainerError> {
    files
        .iter()
        .map(|file| {
            let track = Track::read(file, description, mains_hz)?;
            audience.line(&format!(
                "{}: {} time steps, {} electrodes interpolated, {} counts at the rail",
                track.name,
                track.steps.len(),
                track.interpolated.len(),
                track.saturated
            ));
            for warning in &track.warnings {
                audience.line(&format!("{}: warning: {warning}", track.name));
            }
            Ok(track)
        })
        .collect()
}

fn read_test(
    files: &[PathBuf],
    model: &Artifact,
    mains_hz: u32,
    audience: &mut impl Audience,
) -> Result<Dataset, TrainerError> {
    let tracks = read_tracks(files, &model.description, mains_hz, audience)?;
    let mut test = Dataset::whole(&tracks)?;
    test.scale(1.0 / model.description.input.sd_uv);
    Ok(test)
}

impl Material {
    /// Reads recordings and scales them to a standard deviation of 1 over the training part.
    fn read(
        files: &[PathBuf],
        description: &Description,
        mains_hz: u32,
        audience: &mut impl Audience,
    ) -> Result<Self, TrainerError> {
        let tracks = read_tracks(files, description, mains_hz, audience)?;
        let mut split = Dataset::split(&tracks)?;
        let mut whole = Dataset::whole(&tracks)?;
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
        audience.line(&format!(
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

    /// The directions that PCA keeps, of the training part alone.
    fn directions(&self) -> Vec<Vec<f32>> {
        pca::principal_directions(pca::second_moment(&self.split.training), CODE)
    }
}
