//! A model beside PCA with as many numbers, on recordings that need not be those of the training.

use crate::card;
use crate::dataset::Dataset;
use crate::electrode_error::{ElectrodeError, ElectrodeSums};
use crate::error::TrainerError;
use crate::evaluate::{Evaluation, Table, evaluate_blocks};
use crate::packed::{RateFigures, RateTable, evaluate as evaluate_packed};
use crate::progress::ProgressObserver;
use crate::selection::{self, file_name};
use crate::track::{Track, read_tracks};
use crate::truncation::{TruncationError, TruncationSums};
use artifact::{Artifact, Figures, Mode, PackedFigures, Pca};
use serde_json::{Value as Json, json};
use std::fmt;
use std::path::Path;

/// Figures of a model, and of PCA with the same number of components, on the same recordings.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Id of the model.
    pub model: String,
    /// Mode of the model.
    pub mode: Mode,
    /// Figures of the model.
    pub network: Evaluation,
    /// Figures of PCA; `None` if the artifact has no `pca.safetensors`.
    pub pca: Option<Evaluation>,
    /// Number of numbers in a code.
    pub numbers: usize,
    /// Number of electrodes that every recording has.
    pub real_electrodes: usize,
    /// File names of the recordings.
    pub recordings: Vec<String>,
    /// Errors of the model at each electrode, in the order of the montage.
    pub electrode_errors: Vec<ElectrodeError>,
    /// Errors of PCA with fewer numbers, in ascending order, up to all of them; empty without PCA.
    pub pca_by_numbers: Vec<TruncationError>,
    /// Bits and error of the packed model at each rate, finest first; empty if the artifact has none.
    pub packed: Vec<RateFigures>,
    /// Figures of the Karhunen-Loeve transform of a block, coded alike but without prediction, from the packed model's
    /// card; empty if its test recordings are others.
    pub without_prediction: Vec<PackedFigures>,
    /// Number of time steps from one code, and one packed block, to the next.
    pub hop: usize,
    /// Unit of the network's input, `input.sd_uv`, uV.
    pub sd_uv: f64,
}

impl Comparison {
    /// Measures a model and its PCA on tracks, which have passed the model's front end.
    ///
    /// # Errors
    /// If a track is shorter than a window, or the model cannot be turned into integers.
    pub fn new(
        model: &Artifact,
        pca: Option<&Pca>,
        tracks: &[Track],
    ) -> Result<Self, TrainerError> {
        let description = &model.description;
        let mut dataset = Dataset::from_tracks(tracks, description.dimensions())?;
        dataset.scale(1.0 / description.input.sd_uv);
        let mut electrodes = ElectrodeSums::new(description.montage.electrodes.len());
        let is_pca = description.mode == Mode::Pca;
        let mut truncation = is_pca.then(|| TruncationSums::new(model)).transpose()?;
        let network = evaluate_blocks(model, &dataset, |block| {
            electrodes.add(block);
            if let Some(sums) = &mut truncation {
                sums.add(block);
            }
        })?;
        let pca = match pca {
            _ if is_pca => Some(network),
            Some(pca) => {
                let linear = pca.to_model(description.clone())?;
                let sums = truncation.insert(TruncationSums::new(&linear)?);
                Some(evaluate_blocks(&linear, &dataset, |block| sums.add(block))?)
            }
            None => None,
        };
        let is_recorded = |label: &String| {
            !tracks
                .iter()
                .any(|track| track.interpolated.contains(label))
        };
        let electrode_errors = electrodes.errors(description, is_recorded);
        let recorded = electrode_errors.iter().filter(|error| error.is_recorded);
        Ok(Self {
            model: model.id.to_string(),
            mode: description.mode,
            network,
            pca,
            numbers: description.code.numbers,
            real_electrodes: recorded.count(),
            recordings: tracks.iter().map(|track| track.name.clone()).collect(),
            electrode_errors,
            pca_by_numbers: truncation.map_or_else(Vec::new, |sums| sums.errors_by_numbers()),
            packed: match &model.packed {
                Some(packed) => evaluate_packed(packed, tracks, description)?,
                None => Vec::new(),
            },
            without_prediction: without_prediction(model, tracks),
            hop: description.window.hop,
            sd_uv: description.input.sd_uv,
        })
    }

    /// Returns the number of bits of an integer code.
    pub fn bits_per_window(&self) -> usize {
        self.bits_of(self.numbers)
    }

    /// Returns the number of bits of an integer code with this number of numbers.
    pub fn bits_of(&self, numbers: usize) -> usize {
        self.network.format.bits(numbers)
    }

    /// Returns the figures as a JSON object.
    pub fn to_json(&self) -> Json {
        let pca = self.pca.as_ref();
        json!({
            "model": self.model,
            "mode": self.mode.to_string(),
            "recordings": self.recordings,
            "windows": self.network.windows,
            "electrodes": self.network.electrodes,
            "real_electrodes": self.real_electrodes,
            "numbers": self.numbers,
            "code_format": self.network.format.to_string(),
            "bits_per_window": self.bits_per_window(),
            "mse_float": self.network.float.mse,
            "mse_int8": self.network.integer.mse,
            "mse_pca": pca.map(|pca| pca.float.mse),
            "mse_pca_int8": pca.map(|pca| pca.integer.mse),
            "prd_percent_float": self.network.float.prd_percent,
            "prd_percent_int8": self.network.integer.prd_percent,
            "prd_percent_pca": pca.map(|pca| pca.float.prd_percent),
            "prd_percent_pca_int8": pca.map(|pca| pca.integer.prd_percent),
            "input_clipped": self.network.input_clipped,
            "codes_at_rail": self.network.code_clipped,
            "packed_without_prediction": self.without_prediction,
            "packed": self.packed.iter().map(|figures| figures.to_json()).collect::<Vec<_>>(),
        })
    }

    /// Returns the figures that `figure` selects, for the training card.
    pub(crate) fn figures(
        &self,
        figure: fn(&crate::evaluate::ReconstructionError) -> f64,
    ) -> Option<Figures> {
        let pca = self.pca.as_ref()?;
        Some(card::figures(&self.network, pca, figure))
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = format!("PCA-{}", self.numbers);
        let mut rows = Vec::new();
        if self.mode != Mode::Pca {
            rows.push(("autoencoder", self.network));
        }
        rows.extend(self.pca.map(|pca| (name.as_str(), pca)));
        write!(f, "{}", Table(&rows))?;
        writeln!(
            f,
            "{} bits per window; {} of {} electrodes were recorded",
            self.bits_per_window(),
            self.real_electrodes,
            self.network.electrodes
        )?;
        if self.packed.is_empty() {
            return Ok(());
        }
        writeln!(f, "\npacked code, a block every {} steps", self.hop)?;
        write!(f, "{}", RateTable(&self.packed))?;
        if self.without_prediction.is_empty() {
            return Ok(());
        }
        writeln!(f, "\nKLT of a block, coded alike, without prediction")?;
        writeln!(f, "rate   bits of a block       MSE")?;
        for figures in &self.without_prediction {
            let PackedFigures {
                rate, bits, mse, ..
            } = figures;
            writeln!(f, "{rate:>4} {bits:>17.1} {mse:>9.5}")?;
        }
        Ok(())
    }
}

/// Returns the figures in the card of the packed model if they are of these recordings.
fn without_prediction(model: &Artifact, tracks: &[Track]) -> Vec<PackedFigures> {
    let card = model
        .packed
        .as_ref()
        .map(|packed| &packed.description.training);
    let names = tracks.iter().map(|track| &track.name);
    let of_these = card.filter(|card| names.eq(&card.test_files));
    of_these.map_or_else(Vec::new, |card| card.without_prediction.clone())
}

/// Evaluates the artifact in `folder`, and its PCA, on recordings. `names` selects them in `data` or by path; if it
/// is empty, those of the training card are used. `mains_hz` replaces the mains frequency of the training.
///
/// # Errors
/// If the artifact or a recording cannot be used.
pub fn compare(
    folder: &Path,
    data: &Path,
    names: &[String],
    mains_hz: Option<u32>,
    observer: &mut impl ProgressObserver,
) -> Result<Comparison, TrainerError> {
    let model = Artifact::read(folder)?;
    let pca = Pca::read(folder)?;
    let card = &model.description.training;
    let names = if names.is_empty() {
        &card.test_files
    } else {
        names
    };
    if names.is_empty() {
        return Err(TrainerError::NothingToTest);
    }
    let files = selection::recordings(data, names)?;
    for file in &files {
        if card.train_files.contains(&file_name(file)) {
            observer.message(&format!(
                "warning: the model was trained on {}; its error there says nothing about other recordings",
                file_name(file)
            ));
        }
    }
    if pca.is_none() && model.description.mode != Mode::Pca {
        observer.message("the artifact has no pca.safetensors, so there is no comparison with PCA");
    }
    let mains_hz = mains_hz.unwrap_or(card.mains_hz);
    let tracks = read_tracks(&files, &model.description, mains_hz, observer)?;
    observer.message("evaluating ...");
    Comparison::new(&model, pca.as_ref(), &tracks)
}
