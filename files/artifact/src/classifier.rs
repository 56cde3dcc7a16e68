//! A classifier of EEG: spatial filters for the device, and a decision about their band powers for
//! the host.

mod decision;
mod error;

pub use decision::{Decision, LEVEL_OF_ONE, LEVELS_PER_OCTAVE, Prediction, energy, log_energies};
pub use error::ClassifierError;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::ops::RangeInclusive;
use std::path::Path;

/// Largest number of spatial filters that a device accepts.
pub const MAX_FEATURES: usize = 8;
/// Largest sum of the magnitudes of a filter's weights. Inputs are at most 4,096 in magnitude, so
/// the weighted sum over all electrodes then fits the device's 24-bit accumulator.
pub const LARGEST_ROW: u32 = 2_047;

/// Largest gain from a filter's output, which is below 2^23, to the output of a section. The
/// difference of two section outputs, which the next section multiplies, then stays below 2^31.
const LARGEST_GAIN: f64 = 128.0;
/// Limits within which no score overflows: the window of a decision in hops (some minutes), and the
/// magnitude of a weight or bias.
const LARGEST_WINDOW: u32 = 4_096;
const LARGEST_WEIGHT: f64 = 1e6;
/// Largest number of steps that the band-pass's impulse response may take to decay, and the
/// magnitude below which it has decayed.
const DECAY: (usize, f64) = (20_000, 1e-6);

/// A classifier, as stored in its file. [`Self::read`] and [`Self::parse`] check it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Classifier {
    /// Version of the file format, always 1.
    pub format: u32,
    /// Electrodes of the montage, in the device's order.
    pub electrodes: Vec<String>,
    /// Rate of the time steps, Hz.
    pub step_rate_hz: u16,
    /// Steps from one set of features to the next.
    pub hop_steps: u8,
    /// Band-pass that follows each spatial filter.
    pub band: Band,
    /// The rule that turns features into a prediction.
    pub decision: DecisionRule,
    /// Spatial filters, 1 to [`MAX_FEATURES`]. Each yields one feature.
    pub filters: Vec<SpatialFilter>,
    /// Training data, and accuracy on trials that were not used for training.
    pub training: ClassifierTraining,
}

/// The band-pass that follows each spatial filter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Band {
    /// Lower and upper -3 dB edge, Hz.
    pub hz: [f64; 2],
    /// Two sections `y0 = gain (x0 - x2) + a1 y1 + a2 y2` at the step rate, each as gain, a1 and a2
    /// in Q32.
    pub sections: [[i64; 3]; 2],
}

/// A spatial filter: a weighted sum of all electrodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpatialFilter {
    /// Weight of each electrode, -127..=127. The magnitudes sum to at most [`LARGEST_ROW`].
    pub weights: Vec<i8>,
    /// How strongly the source that the filter extracts appears at each electrode, relative to the
    /// strongest electrode, -1..=1. For display only; the device does not use it.
    pub pattern: Vec<f32>,
}

/// A linear discriminant for each class, applied to the logarithms of smoothed band powers.
///
/// With `x_f = ln(mean energy of feature f over the window)`, class c has the score
/// `bias[c] + sum_f weights[c][f] x_f`. The softmax of the scores gives the probabilities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DecisionRule {
    /// The classes that the rule distinguishes, two or more.
    pub classes: Vec<Class>,
    /// Number of hops over which each energy is averaged.
    pub window_hops: u32,
    /// For each class, the weight of each feature.
    pub weights: Vec<Vec<f64>>,
    /// Constant term of each class's score.
    pub bias: Vec<f64>,
}

/// One of the classes that a classifier distinguishes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Class {
    /// Event code in [`Class::CODES`], such as 769; `NeuroOutput` names classes by these numbers.
    pub code: i32,
    /// Label of the event in the recordings, such as `T1`.
    pub event: String,
}

impl Class {
    /// Valid codes: 16-bit codes of event files, without 0, which stands for no decision.
    pub const CODES: RangeInclusive<i32> = 1..=65_535;
}

/// How a classifier was trained.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassifierTraining {
    /// File names of the training recordings.
    pub train_files: Vec<String>,
    /// Start and end of the part of each trial that was used, in seconds after the trial's event.
    pub trial_s: [f64; 2],
    /// Number of training trials of each class, in the order of the classes.
    pub trials: Vec<u32>,
    /// Results of cross-validation, which leaves each recording, or each block of trials, out of
    /// training in turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cross_validation: Option<ClassifierFigures>,
    /// Results on the test recordings; `None` if there were none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<ClassifierFigures>,
}

/// How often a classifier was right on trials that it was not trained on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassifierFigures {
    /// Fraction of the trials that were classified correctly, 0..=1.
    pub accuracy: f64,
    /// 95 % confidence interval of the accuracy (Wilson).
    pub accuracy_95: [f64; 2],
    /// Area under the receiver operating characteristic, 0..=1; the mean over all pairs of classes.
    pub auc: f64,
    /// `auc` without quantisation: with filters, energies and sums in floating point.
    pub auc_float: f64,
    /// Number of trials by true class (row) and decision (column).
    pub confusion: Vec<Vec<u32>>,
    /// Results on each left-out or test recording, or on each left-out block of trials.
    pub parts: Vec<PartFigures>,
}

/// How often a classifier was right on one recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartFigures {
    /// File name of the recording, or number of the block of trials.
    pub name: String,
    /// Number of trials in this part.
    pub trials: u32,
    /// Number of trials that were classified correctly.
    pub right: u32,
}

impl Classifier {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// If the file cannot be read, is not a classifier, or a number in it is out of its range.
    pub fn read(path: &Path) -> Result<Self, ClassifierError> {
        let text = std::fs::read_to_string(path).map_err(ClassifierError::file(path))?;
        Self::parse(&text)
    }

    /// Parses and checks the text of a file.
    ///
    /// # Errors
    /// If the text is not a classifier, or a number in it is out of its range.
    pub fn parse(text: &str) -> Result<Self, ClassifierError> {
        let classifier: Self = toml::from_str(text)?;
        classifier.check()?;
        Ok(classifier)
    }

    /// Returns the classifier as the text of a file, which [`Self::parse`] reads.
    ///
    /// # Errors
    /// If the TOML library cannot serialise a number.
    pub fn to_toml(&self) -> Result<String, ClassifierError> {
        Ok(toml::to_string(self)?)
    }

    /// Returns the id by which a device's features name their filters: the first four bytes of the
    /// SHA-256 over band-pass and weights.
    pub fn id(&self) -> u32 {
        let mut hash = Sha256::new();
        for coefficient in self.band.sections.as_flattened() {
            hash.update(coefficient.to_le_bytes());
        }
        hash.update(self.weight_bytes());
        let digest = hash.finalize();
        u32::from_be_bytes([digest[0], digest[1], digest[2], digest[3]])
    }

    /// Returns the weights of all filters as bytes, in the order filter, electrode.
    pub fn weight_bytes(&self) -> Vec<u8> {
        let weights = self.filters.iter().flat_map(|filter| &filter.weights);
        weights.map(|weight| weight.cast_unsigned()).collect()
    }

    /// Returns the mask of the electrodes that have a weight in any filter; bit n is electrode n.
    pub fn used_electrodes(&self) -> u64 {
        let weights = self.filters.iter().map(|filter| {
            let used = filter.weights.iter().enumerate().filter(|(_, w)| **w != 0);
            used.fold(0, |mask, (electrode, _)| mask | 1 << electrode)
        });
        weights.fold(0, |all, mask: u64| all | mask)
    }

    /// Checks all ranges, and that no value computed on the device exceeds 32 bits.
    fn check(&self) -> Result<(), ClassifierError> {
        let field = |field: &'static str, is_valid: bool, expected: &'static str| {
            let error = ClassifierError::Field { field, expected };
            is_valid.then_some(()).ok_or(error)
        };
        let Self { filters, decision, .. } = self;
        let (electrodes, features) = (self.electrodes.len(), filters.len());
        let classes = decision.classes.len();
        field("format", self.format == 1, "1")?;
        field("electrodes", (1..=64).contains(&electrodes), "1 to 64 labels")?;
        field("step_rate_hz", self.step_rate_hz > 0, "1 or more")?;
        field("hop_steps", self.hop_steps > 0, "1 or more")?;
        field("filters", (1..=MAX_FEATURES).contains(&features), "1 to 8 filters")?;
        let is_filter = |filter: &SpatialFilter| {
            let magnitudes = filter.weights.iter().map(|w| u32::from(w.unsigned_abs()));
            filter.weights.len() == electrodes
                && filter.pattern.len() == electrodes
                && !filter.weights.contains(&i8::MIN)
                && (1..=LARGEST_ROW).contains(&magnitudes.sum::<u32>())
        };
        field(
            "filters.weights",
            filters.iter().all(is_filter),
            "one weight and one part of the pattern for each electrode, weights from -127 to 127, \
             and the magnitudes of a filter's weights must sum to 1 to 2,047",
        )?;
        field("decision.classes", classes > 1, "two or more")?;
        let is_repeated = |(index, class): (usize, &Class)| {
            let before = &decision.classes[..index];
            before.iter().any(|other| other.code == class.code)
        };
        field(
            "decision.classes",
            !decision.classes.iter().enumerate().any(is_repeated),
            "different codes",
        )?;
        field(
            "decision.classes",
            (decision.classes.iter()).all(|class| Class::CODES.contains(&class.code)),
            "codes from 1 to 65,535",
        )?;
        field(
            "decision.window_hops",
            (1..=LARGEST_WINDOW).contains(&decision.window_hops),
            "1 to 4,096",
        )?;
        let weights = decision.weights.iter();
        let is_whole = weights.len() == classes
            && weights.clone().all(|row| row.len() == features)
            && decision.bias.len() == classes;
        let mut numbers = weights.flatten().chain(&decision.bias);
        field(
            "decision",
            is_whole && numbers.all(|number| number.abs() <= LARGEST_WEIGHT),
            "a bias for each class, and a weight for each class and filter, of 10^6 at most",
        )?;
        field(
            "band.sections",
            self.band.largest_gain() < LARGEST_GAIN,
            "a stable band-pass with coefficients below 4.0 and no gain of 128 or more",
        )
    }
}

impl Band {
    /// Returns the largest gain (the sum of the magnitudes of the impulse response) from the input
    /// of the band-pass to the output of any section; infinite if a response does not decay.
    fn largest_gain(&self) -> f64 {
        let mut states = [[0.0; 4]; 2];
        let mut gains = [0.0; 2];
        let mut last = f64::INFINITY;
        for n in 0..DECAY.0 {
            let mut x = if n == 0 { 1.0 } else { 0.0 };
            for ((coefficients, state), gain) in
                self.sections.iter().zip(&mut states).zip(&mut gains)
            {
                #[expect(clippy::cast_precision_loss, reason = "coefficients are below 2^34")]
                let [b, a1, a2] = coefficients.map(|q32| q32 as f64 / 4_294_967_296.0);
                let [x1, x2, y1, y2] = *state;
                let y: f64 = b * (x - x2) + a1 * y1 + a2 * y2;
                *state = [x, x1, y, y1];
                *gain += y.abs();
                x = y;
            }
            last = x.abs();
        }
        let mut coefficients = self.sections.as_flattened().iter();
        let is_small = coefficients.all(|q32| q32.unsigned_abs() <= 1 << 34);
        let decays = states.as_flattened().iter().all(|value| value.abs() < DECAY.1);
        if is_small && decays && last < DECAY.1 { gains[0].max(gains[1]) } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests;
