//! Figures of a model on recordings, whether it was trained on them or not.

use crate::classify::{ClassifierLossOptions, ClassifierLossTable, CodingLoss};
use crate::dataset::Dataset;
use crate::electrode_error::{ElectrodeError, ElectrodeSums};
use crate::error::TrainerError;
use crate::evaluate::{CodedBlock, Evaluation, ReconstructionError, Table, evaluate_blocks};
use crate::overlap::OverlapMean;
use crate::packed::{self, RateTable};
use crate::people::{People, read_tracks};
use crate::person_error::{PersonError, Table as PeopleTable};
use crate::progress::ProgressObserver;
use crate::selection::{self, TestFiles, file_name};
use artifact::{Artifact, Figures, Mode, PackedFigures, Pca};
use nalgebra::DMatrix;
use packed_fit::Track;
use packed_fit::{RateFigures, evaluate as evaluate_packed};
use serde_json::{Value as Json, json};
use std::fmt;
use std::path::Path;

/// Figures of a model, measured on recordings: for its network, for PCA with as many components as
/// a code of the network has values, and for its packed code.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Id of the model, hexadecimal.
    pub model: String,
    /// Mode of the model.
    pub mode: Mode,
    /// Number of electrodes of the montage.
    pub electrodes: usize,
    /// Number of electrodes that are recorded, not interpolated, in every recording.
    pub real_electrodes: usize,
    /// File names of the recordings.
    pub recordings: Vec<String>,
    /// Figures of the codes of the network and of PCA; `None` if the model has no network.
    pub codes: Option<CodeComparison>,
    /// Bits and error of the packed model at each rate, finest first; empty if the artifact has no
    /// packed model.
    pub packed: Vec<RateFigures>,
    /// Rate of the packed code with which a device starts; `None` without a packed model.
    pub packed_rate: Option<u8>,
    /// Figures of a code that transforms each block by the Karhunen-Loeve transform and differs
    /// from the packed code only in that it does not predict. They are read from the packed model's
    /// training card; empty if the card has other test recordings.
    pub without_prediction: Vec<PackedFigures>,
    /// Number of time steps from one code to the next, and from one packed block to the next.
    pub hop: usize,
    /// Unit of the network's input, `input.sd_uv`, uV.
    pub sd_uv: f64,
    /// Error for each person, with substitution on and off. Empty after training, and if the model
    /// has no network or no table of substitutions.
    pub(crate) people: Vec<PersonError>,
    /// Loss of classifiers with each code; `None` if it was not requested.
    pub(crate) classifiers: Option<ClassifierLossTable>,
}

impl Comparison {
    /// Measures a model and its PCA on tracks, which have passed the model's front end. If `loss`
    /// is given, also measures the loss of classifiers; `loss` must have the same recordings.
    ///
    /// # Errors
    /// If a track is shorter than a window, or the model cannot be turned into integers.
    pub(crate) fn new(
        model: &Artifact,
        pca: Option<&Pca>,
        tracks: &[Track],
        mut loss: Option<CodingLoss>,
    ) -> Result<Self, TrainerError> {
        let description = &model.description;
        let is_recorded =
            |label: &String| !tracks.iter().any(|track| track.interpolated.contains(label));
        let codes = if description.mode.has_network() {
            let mut dataset = Dataset::from_tracks(tracks, description.dimensions())?;
            dataset.scale(1.0 / description.input.sd_uv);
            let loss = loss.as_mut();
            Some(CodeComparison::new(model, pca, &dataset, is_recorded, loss)?)
        } else {
            None
        };
        let (mut rates, mut added) = (0.., Ok(()));
        let mut observe = |decoded: &[DMatrix<f32>]| {
            if let (Some(loss), Some(rate)) = (&mut loss, rates.next()) {
                let decoded = decoded.iter().map(DMatrix::as_slice);
                if added.is_ok() {
                    added = loss.add(&format!("packed, rate {rate}"), decoded);
                }
            }
        };
        let packed = match &model.packed {
            Some(packed) => evaluate_packed(packed, tracks, description, &mut observe)?,
            None => Vec::new(),
        };
        added?;
        let electrodes = &description.montage.electrodes;
        let recorded = electrodes.iter().filter(|label| is_recorded(label));
        Ok(Self {
            model: model.id.to_string(),
            mode: description.mode,
            electrodes: electrodes.len(),
            real_electrodes: recorded.count(),
            recordings: tracks.iter().map(|track| track.name.clone()).collect(),
            codes,
            packed,
            classifiers: loss.map(|loss| loss.table),
            packed_rate: model.packed.as_ref().map(|packed| packed.description.rate),
            without_prediction: without_prediction(model, tracks),
            hop: description.window.hop,
            sd_uv: description.input.sd_uv,
            people: Vec::new(),
        })
    }

    /// Returns the figures as a JSON object. Without a network, the figures of codes are left out.
    pub fn to_json(&self) -> Json {
        let mut object = json!({
            "model": self.model,
            "mode": self.mode.to_string(),
            "recordings": self.recordings,
            "electrodes": self.electrodes,
            "real_electrodes": self.real_electrodes,
            "packed_without_prediction": self.without_prediction,
            "packed": self.packed.iter().map(packed::to_json).collect::<Vec<_>>(),
            "classifiers": self.classifiers.as_ref().map(ClassifierLossTable::to_json),
            "people": self.people.iter().map(PersonError::to_json).collect::<Vec<_>>(),
        });
        let codes = self.codes.as_ref().map(CodeComparison::to_json);
        if let (Json::Object(object), Some(Json::Object(codes))) = (&mut object, codes) {
            object.extend(codes);
        }
        object
    }

    /// Returns the figures that `figure` selects, for the training card. They are rounded to six
    /// decimals: a training run on one subject has no more significant digits.
    pub(crate) fn figures(&self, figure: fn(&ReconstructionError) -> f64) -> Option<Figures> {
        let codes = self.codes.as_ref()?;
        let pca = codes.pca.as_ref()?;
        let figure = |error| (figure(error) * 1e6).round() / 1e6;
        Some(Figures {
            autoencoder_float: figure(&codes.network.float),
            autoencoder_int8: figure(&codes.network.integer),
            pca_float: figure(&pca.float),
            pca_int8: figure(&pca.integer),
        })
    }

    /// Prints the errors of network and PCA.
    fn fmt_codes(&self, codes: &CodeComparison, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let models = codes.models("autoencoder", self.mode);
        let rows = models.iter().map(|(name, errors)| (name.as_str(), *errors));
        write!(f, "{}", Table(&rows.collect::<Vec<_>>()))?;
        writeln!(
            f,
            "{} bits per window; {} of {} electrodes were recorded",
            codes.bits_per_window(),
            self.real_electrodes,
            self.electrodes
        )
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.codes {
            Some(codes) => self.fmt_codes(codes, f)?,
            None => writeln!(
                f,
                "no network; {} of {} electrodes were recorded",
                self.real_electrodes, self.electrodes
            )?,
        }
        if !self.people.is_empty() {
            write!(f, "\n{}", PeopleTable(&self.people))?;
        }
        if let Some(classifiers) = &self.classifiers {
            write!(f, "{classifiers}")?;
        }
        if self.packed.is_empty() {
            return Ok(());
        }
        writeln!(
            f,
            "\npacked code, a block every {} steps; MSE in units of ({:.2} uV)^2",
            self.hop, self.sd_uv
        )?;
        write!(f, "{}", RateTable(&self.packed))?;
        if self.without_prediction.is_empty() {
            return Ok(());
        }
        writeln!(f, "\nKLT of a block, coded alike, without prediction")?;
        writeln!(f, "rate   bits of a block       MSE")?;
        for figures in &self.without_prediction {
            let PackedFigures { rate, bits, mse, .. } = figures;
            writeln!(f, "{rate:>4} {bits:>17.1} {mse:>9.5}")?;
        }
        Ok(())
    }
}

/// Returns the figures of the Karhunen-Loeve transform from the packed model's training card; empty
/// unless `tracks` are the card's test recordings.
fn without_prediction(model: &Artifact, tracks: &[Track]) -> Vec<PackedFigures> {
    let card = model.packed.as_ref().map(|packed| &packed.description.training);
    let names = tracks.iter().map(|track| &track.name);
    let of_these = card.filter(|card| names.eq(&card.test_files));
    of_these.map_or_else(Vec::new, |card| card.without_prediction.clone())
}

/// Evaluates the artifact in `folder`, and its `pca.safetensors` if present, on recordings whose
/// bad electrodes are interpolated as in training. If the model has a table of substitutions and a
/// network, also measures each person's error with bad electrodes substituted, and on the unchanged
/// recordings. `files` selects the recordings; by default, the test recordings of the training
/// card.
///
/// # Errors
/// If the artifact or a recording cannot be used.
pub fn compare(
    folder: &Path,
    files: &TestFiles,
    observer: &mut impl ProgressObserver,
) -> Result<Comparison, TrainerError> {
    compare_for(folder, files, None, observer)
}

/// Evaluates an artifact like [`compare`], and the loss of classifiers if `loss` is given.
///
/// # Errors
/// If [`compare`] would fail, or the recordings lack the events or have too few trials.
pub(crate) fn compare_for(
    folder: &Path,
    files: &TestFiles,
    loss: Option<&ClassifierLossOptions>,
    observer: &mut impl ProgressObserver,
) -> Result<Comparison, TrainerError> {
    let model = Artifact::read(folder)?;
    let pca = Pca::read(folder)?;
    let card = &model.description.training;
    let names = if files.test.is_empty() { &card.test_files } else { &files.test };
    if names.is_empty() {
        return Err(TrainerError::NothingToTest);
    }
    let recordings = selection::recordings(files.folder(), names)?;
    for file in &recordings {
        if card.train_files.contains(&file_name(file)) {
            observer.message(&format!(
                "warning: the model was trained on {}; its error there says nothing about other recordings",
                file_name(file)
            ));
        }
    }
    let mode = model.description.mode;
    if pca.is_none() && mode.has_network() && mode != Mode::Pca {
        observer.message("the artifact has no pca.safetensors, so there is no comparison with PCA");
    }
    let mains_hz = files.mains_hz.unwrap_or(card.mains_hz);
    let tracks = read_tracks(&recordings, &model.description, mains_hz, observer)?;
    let recorded = if PersonError::is_measured(&model) { tracks.clone() } else { Vec::new() };
    let electrodes = &model.description.montage.electrodes;
    let people = People::new(tracks, electrodes, files.subject.as_deref(), observer)?;
    let loss = loss.map(|options| {
        CodingLoss::new(options, &recordings, &people, &model.description, mains_hz)
    });
    let loss = loss.transpose()?;
    observer.message("evaluating ...");
    Ok(Comparison {
        people: PersonError::of_each(&model, &people, &recorded)?,
        ..Comparison::new(&model, pca.as_ref(), &people.tracks, loss)?
    })
}

/// Figures of a network's codes, and of PCA with the same number of components, on the same
/// recordings.
#[derive(Clone, Debug)]
pub struct CodeComparison {
    /// Errors of the network, which is a linear map in mode `pca`.
    pub network: Evaluation,
    /// Errors of PCA; `None` if the artifact has no `pca.safetensors`.
    pub pca: Option<Evaluation>,
    /// Number of values in a code.
    pub numbers: usize,
    /// Errors of the network at each electrode, in the order of the montage.
    pub(crate) electrode_errors: Vec<ElectrodeError>,
}

impl CodeComparison {
    /// Measures a network and its PCA on a dataset in units of `input.sd_uv`. `is_recorded` returns
    /// whether an electrode was recorded in every recording.
    ///
    /// # Errors
    /// If the model cannot be turned into integers, or its codes cannot be decoded.
    pub(crate) fn new(
        model: &Artifact,
        pca: Option<&Pca>,
        dataset: &Dataset,
        is_recorded: impl Fn(&String) -> bool,
        mut loss: Option<&mut CodingLoss>,
    ) -> Result<Self, TrainerError> {
        let description = &model.description;
        let mut electrodes = ElectrodeSums::new(description.montage.electrodes.len());
        let name = description.mode.to_string();
        let network = evaluate_for(model, dataset, (&name, loss.as_deref_mut()), |block| {
            electrodes.add(block);
        })?;
        let pca = match pca {
            _ if description.mode == Mode::Pca => Some(network),
            Some(pca) => {
                let linear = pca.to_model(description.clone())?;
                Some(evaluate_for(&linear, dataset, ("pca", loss), |_| ())?)
            }
            None => None,
        };
        Ok(Self {
            network,
            pca,
            numbers: description.code.numbers,
            electrode_errors: electrodes.errors(description, is_recorded),
        })
    }

    /// Returns the errors of the network, under the name `name`, and of PCA. In mode `pca` both are
    /// the same, so only the errors of PCA are returned.
    pub(crate) fn models(&self, name: &str, mode: Mode) -> Vec<(String, Evaluation)> {
        let network = (mode != Mode::Pca).then(|| (name.to_owned(), self.network));
        let pca = self.pca.map(|pca| (format!("PCA-{}", self.numbers), pca));
        network.into_iter().chain(pca).collect()
    }

    fn to_json(&self) -> Json {
        let (errors, pca) = (self.network, self.pca);
        json!({
            "windows": errors.windows,
            "numbers": self.numbers,
            "code_format": errors.format.to_string(),
            "bits_per_window": self.bits_per_window(),
            "mse_float": errors.float.mse,
            "mse_int8": errors.integer.mse,
            "mse_pca": pca.map(|pca| pca.float.mse),
            "mse_pca_int8": pca.map(|pca| pca.integer.mse),
            "prd_percent_float": errors.float.prd_percent,
            "prd_percent_int8": errors.integer.prd_percent,
            "prd_percent_pca": pca.map(|pca| pca.float.prd_percent),
            "prd_percent_pca_int8": pca.map(|pca| pca.integer.prd_percent),
            "input_clipped": errors.input_clipped,
            "codes_at_rail": errors.code_clipped,
        })
    }

    /// Returns the length of an integer code in bits.
    pub fn bits_per_window(&self) -> usize {
        self.network.format.bits(self.numbers)
    }
}

/// Measures the errors of a model on a dataset and passes each block of windows to `observe`. If
/// `loss` is given, also adds to it the loss of classifiers on the decoded signals, under the name
/// `name`.
fn evaluate_for(
    model: &Artifact,
    dataset: &Dataset,
    (name, loss): (&str, Option<&mut CodingLoss>),
    mut observe: impl FnMut(&CodedBlock),
) -> Result<Evaluation, TrainerError> {
    let mut decoded = OverlapMean::new(dataset, model.description.window.hop);
    let errors = evaluate_blocks(model, dataset, |block| {
        decoded.add(block.decoded_received);
        observe(block);
    })?;
    if let Some(loss) = loss {
        loss.add(name, decoded.signals().iter().map(Vec::as_slice))?;
    }
    Ok(errors)
}
