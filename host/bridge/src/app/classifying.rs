//! Options of the classifier, which decides from the device's features, and options of the
//! published predictions.

use std::path::{Path, PathBuf};

use artifact::classifier::Classifier;
use clap::Args;
use link::Streams;

use crate::error::BridgeError;

const HEADING: &str = "Decisions";

/// The option that says for which classifier a device computes features.
#[derive(Args, Clone, Debug)]
pub struct ClassifierOptions {
    /// Classifier file that `trainer classify` writes; the device computes the features of this
    /// classifier
    #[arg(long, help_heading = HEADING, env = "CORTICODE_CLASSIFIER", value_name = "FILE")]
    pub(crate) classifier: Option<PathBuf>,
}

/// Options that say how a classifier's predictions are published.
#[derive(Args, Clone, Debug)]
pub struct PredictionOptions {
    /// Topic of the predictions of --classifier, a rosneuro_msgs/NeuroOutput for each hop
    #[arg(
        long,
        help_heading = HEADING,
        env = "CORTICODE_PREDICTION_TOPIC",
        default_value = "/smr/neuroprediction/raw",
        value_name = "NAME",
        requires = "classifier"
    )]
    pub(crate) prediction_topic: String,
    /// Seconds over which the band powers are averaged before each decision, instead of the seconds
    /// of the classifier's training; the classifier's figures hold only for the latter
    #[arg(long, help_heading = HEADING, env = "CORTICODE_PREDICTION_WINDOW", value_name = "SECONDS", requires = "classifier", value_parser = seconds)]
    pub(crate) prediction_window: Option<f64>,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok();
    let seconds = seconds.filter(|seconds| (0.05..=60.0).contains(seconds));
    seconds.ok_or_else(|| "a window has 0.05 to 60 seconds".to_owned())
}

/// A classifier, and the topic of its predictions.
#[derive(Clone, Debug)]
pub struct Classifying {
    pub(crate) classifier: Classifier,
    pub(crate) topic: String,
}

impl ClassifierOptions {
    /// Returns `streams`, with the stream of features added if the user names a classifier.
    pub fn streams(&self, streams: Streams) -> Streams {
        if self.classifier.is_some() { streams | Streams::FEATURES } else { streams }
    }

    /// Reads the classifier's file; `None` if the option names none.
    ///
    /// # Errors
    ///
    /// [`BridgeError::Classifier`] if the file is not a classifier.
    pub fn read(&self) -> Result<Option<Classifier>, BridgeError> {
        let path = self.classifier.as_deref();
        path.map(read_classifier).transpose()
    }
}

/// Reads the classifier in the file at `path`.
///
/// # Errors
///
/// [`BridgeError::Classifier`] if the file is not a classifier.
pub(crate) fn read_classifier(path: &Path) -> Result<Classifier, BridgeError> {
    Classifier::read(path).map_err(|source| BridgeError::Classifier(path.to_owned(), source))
}

impl PredictionOptions {
    /// Combines `classifier` with the window and the topic that these options set.
    pub fn classifying(&self, mut classifier: Classifier) -> Classifying {
        if let Some(seconds) = self.prediction_window {
            let hops_per_s = f64::from(classifier.step_rate_hz) / f64::from(classifier.hop_steps);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at most 60 s of hops"
            )]
            let hops = (seconds * hops_per_s).round().max(1.0) as u32;
            classifier.decision.window_hops = hops;
        }
        Classifying { classifier, topic: self.prediction_topic.clone() }
    }
}
