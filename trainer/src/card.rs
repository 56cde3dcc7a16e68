//! The description of a new artifact, and the training card in it.

use crate::error::TrainerError;
use crate::montage_check::MontageCheck;
use artifact::{
    CodeFormat, CodeQuantisation, Decimation, Description, Dimensions, Filters, Input, Mode,
    MontageFile, NetworkShape, Padding, TrainingCard, Window,
};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use packed_fit::Track;
use serde::de::{DeserializeOwned, IntoDeserializer, value::Error as ValueError};
use std::fmt;
use std::path::{Path, PathBuf};

/// Rate of the time steps, the same in every model, Hz.
const STEP_RATE_HZ: u32 = 128;

/// Content of the default montage file: the montage of the paper (arXiv 2008.13485).
const PAPER: &str = include_str!("../../files/montages/paper-61.toml");

/// Montage and shape of a model.
#[derive(Args, Clone, Debug)]
pub(crate) struct ModelOptions {
    /// Montage file: grid, order of the channels, settings of the ADC [default:
    /// files/montages/paper-61.toml].
    #[arg(long)]
    montage: Option<PathBuf>,
    /// Sampling rate of the ADC, Hz [default: the montage's rate].
    #[arg(long, value_name = "HZ")]
    rate: Option<u32>,
    /// Mode and dimensions.
    #[command(flatten)]
    pub(crate) shape: Shape,
}

/// Mode and dimensions of a model. The default lengths of code and window are the paper's.
#[derive(Args, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    /// Layers of the network; pca takes no epochs.
    #[arg(long, default_value = "shortcut", value_parser = choice::<Mode, 4>([
        ("pca", "Linear maps only, fitted without epochs"),
        ("shortcut", "The paper's network plus linear maps, which start as PCA"),
        ("paper", "The paper's network with index unpooling: its codes cannot be decoded, so only `crossval` takes it"),
        ("paper-code-only", "The paper's network with nearest-neighbour unpooling"),
    ]))]
    pub(crate) mode: Mode,
    /// Length of a code: 8 to 256, a multiple of 4, at most steps times electrodes.
    #[arg(long, default_value_t = 128)]
    pub(crate) numbers: usize,
    /// Time steps of a window: 16 or 32.
    #[arg(long, default_value_t = 16)]
    pub(crate) steps: usize,
    /// Time steps from the start of one window to the next: 4, 8 or 16.
    #[arg(long, default_value_t = 8)]
    pub(crate) hop: usize,
    /// Zero padding of both convolutions.
    #[arg(long, default_value = "none", value_parser = choice::<Padding, 3>([
        ("none", "No padding; needs a grid of at least 6 x 8 cells"),
        ("space", "One row and column on each side"),
        ("all", "One row, column and step on each side"),
    ]))]
    pub(crate) padding: Padding,
    /// Integer format of the codes.
    #[arg(long = "code-format", value_name = "CODE_FORMAT", default_value = "int8", value_parser = choice::<CodeFormat, 3>([
        ("int8", "8 bits for each number"),
        ("int8-exponent", "8 bits for each number, and a power of two for each window"),
        ("int16", "16 bits for each number"),
    ]))]
    pub(crate) format: CodeFormat,
}

/// Returns a parser for an option that takes one of `values`, each a pair: a name, from which a `T`
/// is deserialized, and the help for this name.
fn choice<T: DeserializeOwned + Clone + Send + Sync + 'static, const N: usize>(
    values: [(&'static str, &'static str); N],
) -> impl TypedValueParser<Value = T> {
    let values = values.map(|(name, help)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(values)
        .try_map(|name| T::deserialize(name.into_deserializer()) as Result<T, ValueError>)
}

impl fmt::Display for Shape {
    /// Writes the shape as text, without the code format, which does not change the training.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mode, numbers, steps, hop, padding, format: _ } = self;
        write!(
            f,
            "mode {mode}, {numbers} numbers, windows of {steps} steps, hop {hop}, padding {padding}"
        )
    }
}

impl ModelOptions {
    /// Reads the montage file, or returns the paper's montage.
    ///
    /// # Errors
    /// If the file cannot be read or is not a montage.
    pub(crate) fn montage(&self) -> Result<MontageFile, TrainerError> {
        let mut montage = match &self.montage {
            Some(path) => MontageFile::read(path)?,
            None => MontageFile::parse(Path::new("files/montages/paper-61.toml"), PAPER)?,
        };
        montage.adc.rate_hz = self.rate.unwrap_or(montage.adc.rate_hz);
        Ok(montage)
    }
}

/// Returns the description of the paper's chain (arXiv 2008.13485) for a montage, with an empty
/// training card. The decimation differs from the paper's only if the ADC rate is not a multiple of
/// the step rate.
pub(crate) fn description(montage: &MontageFile, shape: Shape) -> Description {
    let adc = montage.adc();
    let decimation = if adc.rate_hz.is_multiple_of(STEP_RATE_HZ) {
        Decimation::Literal
    } else {
        Decimation::Fir
    };
    Description {
        format: 1,
        mode: shape.mode,
        window: Window { steps: shape.steps, hop: shape.hop, rate_hz: STEP_RATE_HZ },
        network: NetworkShape { padding: shape.padding, pool: [2, 2, 2] },
        code: CodeQuantisation { numbers: shape.numbers, format: shape.format },
        grid: montage.grid(),
        montage: montage.montage(),
        adc,
        filters: Filters {
            mains_hz: vec![50, 60],
            notch_q: 30.0,
            harmonics: 0,
            band_hz: [0.5, 60.0],
            order: 5,
            decimation,
        },
        // Training replaces this value by the standard deviation of the recordings.
        input: Input { sd_uv: 1.0 },
        training: TrainingCard::default(),
    }
}

/// Returns the training card's note on how many electrodes were recorded and how many interpolated.
/// `signals` is the number of recorded signals from which all electrodes were computed.
fn note(electrodes: usize, interpolated: usize, signals: usize) -> String {
    if interpolated == 0 {
        return "All electrodes were recorded.".to_owned();
    }
    format!(
        "{interpolated} of {electrodes} electrodes are mixes of recorded ones: the data span at most {signals} dimensions \
         in space, one for each signal that was used, an easy set that favours linear codes. The error is over all \
         electrodes, recorded and mixed."
    )
}

/// Fills in the number of electrodes that every training recording has, and the electrodes that are
/// interpolated because at least one recording lacks them.
pub(crate) fn fill_electrodes(card: &mut TrainingCard, electrodes: &[String], tracks: &[Track]) {
    card.interpolated = interpolated(electrodes, tracks);
    card.interpolated_electrodes = card.interpolated.len();
    card.real_electrodes = electrodes.len() - card.interpolated_electrodes;
    let signals = tracks.iter().map(|track| track.signals).min().unwrap_or(0);
    card.note = note(electrodes.len(), card.interpolated_electrodes, signals);
}

/// Returns the labels of the electrodes that at least one recording lacks.
pub(crate) fn interpolated(electrodes: &[String], tracks: &[Track]) -> Vec<String> {
    let is_interpolated = |label: &&String| tracks.iter().any(|t| t.interpolated.contains(label));
    electrodes.iter().filter(is_interpolated).cloned().collect()
}

/// Returns the training card's text about the parts of the recordings that are not used for
/// training: `held_out`, and the first `settling_steps`.
pub(crate) fn validation(held_out: Option<&str>, settling_steps: usize, rate_hz: u32) -> String {
    let settling_s = settling_steps as f64 / f64::from(rate_hz);
    format!(
        "{}; the first {settling_s:.1} s of every file, in which the filters settle, are left out",
        held_out.unwrap_or("none")
    )
}

/// Returns the description of the model to train, after all checks that need no recording.
///
/// # Errors
/// If the montage has mistakes, no model can have this shape, or its codes could not be decoded.
pub(crate) fn checked_description(
    montage: &MontageFile,
    shape: Shape,
) -> Result<Description, TrainerError> {
    if shape.mode == Mode::Paper {
        return Err(TrainerError::PaperMode);
    }
    description_to_compare(montage, shape)
}

/// Returns the description of a model that is trained only for a comparison, so its codes need not
/// be decodable. Makes every check that is possible before recordings are read.
///
/// # Errors
/// If the montage has mistakes, or no model can have this shape.
pub(crate) fn description_to_compare(
    montage: &MontageFile,
    shape: Shape,
) -> Result<Description, TrainerError> {
    let mistakes = MontageCheck::new(montage).mistakes;
    if !mistakes.is_empty() {
        return Err(TrainerError::MontageMistakes { name: montage.name.clone(), mistakes });
    }
    let description = description(montage, shape);
    artifact::check_description(&description).map_err(TrainerError::Shape)?;
    let Dimensions { steps, electrodes, numbers, .. } = description.dimensions();
    if numbers > steps * electrodes {
        return Err(TrainerError::TooManyNumbers { numbers, steps, electrodes });
    }
    Ok(description)
}
