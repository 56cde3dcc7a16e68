//! The description of a new artifact, and its training card.

use artifact::{
    CodeFormat, CodeQuantisation, Decimation, Description, Dimensions, Figures, Filters, Input,
    Mode, MontageFile, NetworkShape, Padding, TrainingCard, Window,
};

use crate::error::TrainerError;
use crate::evaluate::{Evaluation, ReconstructionError};
use crate::montage_check::MontageCheck;
use crate::track::Track;

/// Rate of the time steps, Hz.
const STEP_RATE_HZ: u32 = 128;

/// What `trainer train` can choose of a model; the defaults of its command line are the paper's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Layers of the network.
    pub mode: Mode,
    /// Number of numbers in a code.
    pub numbers: usize,
    /// Number of time steps in a window.
    pub steps: usize,
    /// Time steps from the start of one window to the start of the next.
    pub hop: usize,
    /// Zero padding of both convolutions.
    pub padding: Padding,
    /// Integer format of the codes.
    pub format: CodeFormat,
}

/// Returns the description of the paper's chain (arXiv 2008.13485) for a montage, with an empty training
/// card. Only an ADC rate that is no multiple of the step rate needs another decimation than the paper's.
pub fn description(montage: &MontageFile, shape: Shape) -> Description {
    let adc = montage.adc();
    let decimation = if adc.rate_hz.is_multiple_of(STEP_RATE_HZ) {
        Decimation::Literal
    } else {
        Decimation::Fir
    };
    Description {
        format: 1,
        mode: shape.mode,
        window: Window {
            steps: shape.steps,
            hop: shape.hop,
            rate_hz: STEP_RATE_HZ,
        },
        network: NetworkShape {
            padding: shape.padding,
            pool: [2, 2, 2],
        },
        code: CodeQuantisation {
            numbers: shape.numbers,
            format: shape.format,
        },
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
        input: Input { sd_uv: 1.0 },
        training: TrainingCard {
            dataset: String::new(),
            citation: String::new(),
            real_electrodes: 0,
            interpolated_electrodes: 0,
            interpolated: Vec::new(),
            note: String::new(),
            train_files: Vec::new(),
            test_files: Vec::new(),
            validation: String::new(),
            mains_hz: 0,
            seed: 0,
            epochs: 0,
            best_epoch: 0,
            windows: 0,
            optimiser: String::new(),
            mse: None,
            prd_percent: None,
        },
    }
}

/// Returns the training card's note about recorded and interpolated electrodes. `signals` is the number of recorded
/// signals from which all electrodes were computed.
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

/// Fills in which electrodes were recorded, and which were interpolated in any training recording.
pub(crate) fn fill_electrodes(card: &mut TrainingCard, electrodes: &[String], tracks: &[Track]) {
    let is_interpolated = |label: &&String| tracks.iter().any(|t| t.interpolated.contains(label));
    card.interpolated = electrodes.iter().filter(is_interpolated).cloned().collect();
    card.interpolated_electrodes = card.interpolated.len();
    card.real_electrodes = electrodes.len() - card.interpolated_electrodes;
    let signals = tracks.iter().map(|track| track.signals).min().unwrap_or(0);
    card.note = note(electrodes.len(), card.interpolated_electrodes, signals);
}

/// Returns the training card's text about the parts of the recordings that training does not see: `held_out`, and the
/// first `settling_steps`.
pub(crate) fn validation(held_out: Option<&str>, settling_steps: usize, rate_hz: u32) -> String {
    #[expect(clippy::cast_precision_loss, reason = "a few thousand steps")]
    let settling_s = settling_steps as f64 / f64::from(rate_hz);
    format!(
        "{}; the first {settling_s:.1} s of every file, in which the filters settle, are left out",
        held_out.unwrap_or("none")
    )
}

/// Returns the figure that `figure` selects, of the network and of PCA, rounded to six decimals.
pub fn figures(
    network: &Evaluation,
    pca: &Evaluation,
    figure: impl Fn(&ReconstructionError) -> f64,
) -> Figures {
    // One training run on one subject does not make more decimals significant.
    let figure = |error| (figure(error) * 1e6).round() / 1e6;
    Figures {
        autoencoder_float: figure(&network.float),
        autoencoder_int8: figure(&network.integer),
        pca_float: figure(&pca.float),
        pca_int8: figure(&pca.integer),
    }
}

/// Returns the description of the model to train, after all checks that need no recording.
///
/// # Errors
/// If the montage has mistakes, no model can have this shape, or its codes could not be decoded.
pub fn checked_description(
    montage: &MontageFile,
    shape: Shape,
) -> Result<Description, TrainerError> {
    if shape.mode == Mode::Paper {
        return Err(TrainerError::PaperMode);
    }
    description_to_compare(montage, shape)
}

/// Returns the description of a model to train and compare, whose codes need not be decodable, after all
/// checks that need no recording.
///
/// # Errors
/// If the montage has mistakes, or no model can have this shape.
pub fn description_to_compare(
    montage: &MontageFile,
    shape: Shape,
) -> Result<Description, TrainerError> {
    let mistakes = MontageCheck::new(montage).mistakes;
    if !mistakes.is_empty() {
        return Err(TrainerError::MontageMistakes {
            name: montage.name.clone(),
            mistakes: mistakes.iter().map(ToString::to_string).collect(),
        });
    }
    let mut description = description(montage, shape);
    // Replaced by the standard deviation of the recordings.
    description.input.sd_uv = 1.0;
    artifact::check_description(&description).map_err(TrainerError::Shape)?;
    let Dimensions {
        steps,
        electrodes,
        numbers,
        ..
    } = description.dimensions();
    let values = steps * electrodes;
    if numbers > values {
        return Err(TrainerError::TooManyNumbers {
            numbers,
            values,
            steps,
            electrodes,
        });
    }
    Ok(description)
}
