//! The command `trainer packed`: fits a packed model to recordings.

mod rate_table;
mod trained;

use crate::card::{self, Shape};
use crate::dataset::Dataset;
use crate::error::TrainerError;
use crate::people::People;
use crate::progress::ProgressObserver;
use crate::selection::{Selected, TrainingFiles, check_writable, refuse_model};
use artifact::{Artifact, CodeFormat, Description, ErrorWeight, Mode, MontageFile, Padding};
use clap::{ArgGroup, Args};
use packed_fit::{FitError, Track, settling_steps};
use std::path::PathBuf;

pub(crate) use rate_table::{RateTable, cells, to_json};
pub(crate) use trained::PackedTrained;

/// Number of time steps of a window that is written to `model.toml`; only networks use this number.
const STEPS: usize = 16;

/// Options of `trainer packed`.
#[derive(Args, Clone, Debug)]
#[command(group = ArgGroup::new("model").args(["artifact", "montage"]).required(true))]
pub(crate) struct PackedOptions {
    /// Folder of the artifact to which the packed model is added; its montage, hop and filters are
    /// used.
    #[arg(long)]
    artifact: Option<PathBuf>,
    #[command(flatten)]
    alone: AloneOptions,
    #[command(flatten)]
    files: TrainingFiles,
    #[command(flatten)]
    fit: FitOptions,
    /// Replace the packed model of --artifact, or the artifact in --out.
    #[arg(long)]
    force: bool,
}

/// Options of a new model without a network.
#[derive(Args, Clone, Debug)]
struct AloneOptions {
    /// Montage file of a new model without a network: grid, order of the channels, settings of the
    /// ADC.
    #[arg(long, requires = "out")]
    montage: Option<PathBuf>,
    /// Folder to write the new model to.
    #[arg(long, requires = "montage", conflicts_with = "artifact")]
    out: Option<PathBuf>,
    /// Sampling rate of the new model's ADC, Hz [default: the montage's rate].
    #[arg(long, value_name = "HZ", requires = "montage", conflicts_with = "artifact")]
    rate: Option<u32>,
    /// Time steps of a block of the new model: 4, 8 or 16 [default: 8].
    #[arg(long, requires = "montage", conflicts_with = "artifact")]
    hop: Option<usize>,
    /// Origin and licence of the recordings, for the new model's training card [default: not
    /// stated].
    #[arg(long, requires = "montage", conflicts_with = "artifact")]
    dataset: Option<String>,
    /// References to cite, for the new model's training card [default: not stated].
    #[arg(long, requires = "montage", conflicts_with = "artifact")]
    citation: Option<String>,
}

/// Options of the fit.
#[derive(Args, Clone, Copy, Debug)]
struct FitOptions {
    /// Number of coefficients of a block: a multiple of 16 up to 256. Fewer need less flash and
    /// time; more reach a smaller error at fine rates [default: 176, or as many as the values of a
    /// block allow].
    #[arg(long)]
    coefficients: Option<usize>,
    /// Start the device with the coarsest rate whose mean squared error is at most this, in units
    /// of the training data's variance [default: rate 4].
    #[arg(long)]
    target_mse: Option<f64>,
    /// Use of the decoded signals: `motor` gives more weight to errors at 8 to 30 Hz that a decoder
    /// sees through spatial filters; a band such as 8..13 does the same for this band [default:
    /// visual inspection; all errors have equal weight].
    #[arg(long = "for", value_name = "USE", value_parser = packed_fit::weight_for)]
    weight: Option<ErrorWeight>,
    /// Weight of the errors in the band of --for, relative to errors at all frequencies [default:
    /// 3].
    #[arg(long, requires = "weight", value_parser = positive)]
    strength: Option<f64>,
}

/// Parses a number above 0.
fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    let number = number.filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "write a number above 0".to_owned())
}

/// Training and test recordings, after the front end.
struct Tracks {
    train: Vec<Track>,
    test: Vec<Track>,
}

/// Trains a packed model, adds it to an artifact or writes it as a new artifact without a network,
/// and returns its figures.
///
/// # Errors
/// If the montage has mistakes, recordings cannot be used, the requested error cannot be reached or
/// files cannot be written.
pub(crate) fn train(
    options: &PackedOptions,
    observer: &mut impl ProgressObserver,
) -> Result<PackedTrained, TrainerError> {
    let alone = &options.alone;
    let (folder, joined, mut description) = match (&options.artifact, &alone.montage, &alone.out) {
        (Some(folder), ..) => {
            let artifact = Artifact::read(folder)?;
            if artifact.packed.is_some() && !options.force {
                return Err(TrainerError::PartExists(folder.to_owned(), "packed model"));
            }
            let description = artifact.description.clone();
            (folder, Some(artifact), description)
        }
        (None, Some(montage), Some(out)) => {
            let montage = MontageFile::read(montage)?;
            refuse_model(out, options.force)?;
            (out, None, alone.description(montage)?)
        }
        _ => unreachable!("clap requires --artifact or --montage with --out"),
    };
    let count = packed_fit::coefficients(options.fit.coefficients, &description)?;
    let selected = options.files.find()?;
    check_writable(folder)?;
    let read =
        |files, observer: &mut _| People::read(files, &options.files, &description, observer);
    let (train, test) = (read(&selected.train, observer)?, read(&selected.test, observer)?);
    let tracks = Tracks { train: train.at_equal_power(observer), test: test.tracks };
    let mut largest = 0.0;
    if joined.is_none() {
        let whole = |tracks| Dataset::from_tracks(tracks, description.dimensions());
        largest = whole(&train.tracks)?.max_abs();
        let sd_uv = whole(&tracks.train)?.deviation();
        if sd_uv <= 0.0 {
            return Err(FitError::Silent.into());
        }
        observer.message(&format!("standard deviation of the training recordings: {sd_uv:.2} uV"));
        description.input.sd_uv = sd_uv;
    }
    let (mut model, trained) = trained::train(&tracks, &description, count, options.fit, observer)?;
    let card = &mut model.description.training;
    [card.train_files, card.test_files] = selected.names();
    card.people = train.card();
    let artifact = if let Some(artifact) = joined {
        artifact.with_packed(Some(model))?
    } else {
        fill_card(&mut description, options, &selected, &train)?;
        Artifact::without_network(description, largest, model)?
    };
    let id = artifact.write(folder)?;
    observer.message(&format!("model {id} written to {}", folder.display()));
    Ok(trained)
}

impl AloneOptions {
    /// Returns the description of a new model without a network.
    fn description(&self, mut montage: MontageFile) -> Result<Description, TrainerError> {
        montage.adc.rate_hz = self.rate.unwrap_or(montage.adc.rate_hz);
        let shape = Shape {
            mode: Mode::Packed,
            numbers: 0,
            steps: STEPS,
            hop: self.hop.unwrap_or(8),
            padding: Padding::None,
            format: CodeFormat::Int8,
        };
        card::checked_description(&montage, shape)
    }
}

/// Fills the training card of a new model without a network.
fn fill_card(
    description: &mut Description,
    options: &PackedOptions,
    selected: &Selected,
    people: &People,
) -> Result<(), TrainerError> {
    let mains_hz = options.files.mains_hz;
    let settling = settling_steps(description, mains_hz)?;
    let card = &mut description.training;
    card::fill_electrodes(card, &description.montage.electrodes, &people.tracks);
    card.people = people.card();
    let or_not_stated = |text: &Option<String>| text.clone().unwrap_or("not stated".to_owned());
    card.dataset = or_not_stated(&options.alone.dataset);
    card.citation = or_not_stated(&options.alone.citation);
    [card.train_files, card.test_files] = selected.names();
    card.validation = card::validation(None, settling, description.window.rate_hz);
    card.mains_hz = mains_hz;
    "none: transform of the signals' covariance, prediction by ridge regression"
        .clone_into(&mut card.optimiser);
    Ok(())
}
