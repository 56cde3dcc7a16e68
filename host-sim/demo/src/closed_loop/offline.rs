//! Decisions of a classifier about a recording, computed without board, bridge or clock.

use std::path::Path;

use ::offline::{Played, first_channels};
use artifact::classifier::{Classifier, Decision};
use model::{HOP, STEP_RATE_HZ, SUBSTITUTION};
use pipeline::{
    Acquisition, ExclusionPolicy, FeatureExtractor, FeatureFilters, Features, Mains, Sample,
    Substitution,
};
use recordings::Missing;

use super::{Trial, filter_delay_s};
use crate::Failure;
use crate::comparison::seconds;

/// A classifier's prediction at one hop.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// Probability of each class, in the classifier's order.
    pub probabilities: Vec<f32>,
    /// Index of the chosen class; `None` if no class is chosen.
    pub class: Option<usize>,
}

/// Cues of a recording, and the prediction of each hop.
pub(super) struct Reference {
    pub(super) trials: Vec<Trial>,
    pub(super) predictions: Vec<Prediction>,
}

/// Returns the features that a device's pipeline computes from samples; empty if the pipeline would
/// refuse the classifier's filters.
pub fn features(
    samples: impl Iterator<Item = Sample>,
    mains: Mains,
    classifier: &Classifier,
) -> Vec<Features> {
    let mut acquisition = Acquisition::new(mains);
    let mut substitution = Box::new(Substitution::NEW);
    let mut extractor = FeatureExtractor::NEW;
    let (id, weights) = (classifier.id(), classifier.weight_bytes());
    let Some(filters) = FeatureFilters::new(id, classifier.band.sections, &weights) else {
        return Vec::new();
    };
    extractor.set_filters(filters);
    let features = samples.filter_map(|sample| {
        substitution.observe_sample(&sample);
        let mut step = acquisition.process_sample(&sample)?;
        if let Some(table) = &SUBSTITUTION {
            substitution.fill_step(&mut step, ExclusionPolicy::AUTOMATIC, table);
        }
        extractor.add_step(&step)
    });
    features.collect()
}

/// Returns the prediction of each hop, as the bridge computes it.
pub fn predictions(features: &[Features], classifier: &Classifier) -> Vec<Prediction> {
    let used = classifier.used_electrodes();
    let mut decision = Decision::new(classifier);
    let predictions = features.iter().map(|hop| {
        let class = if hop.settling || hop.saturated & used != 0 {
            decision.skip_hop();
            None
        } else {
            let prediction = decision.add_hop(hop.levels());
            prediction.is_settled.then(|| prediction.class())
        };
        Prediction { probabilities: decision.probabilities().to_vec(), class }
    });
    predictions.collect()
}

impl Reference {
    /// Reads a recording, and computes the prediction of each hop.
    ///
    /// # Errors
    /// The recording cannot be read, it has no event for any of the classes, or the classifier is
    /// for another model than the built-in one.
    pub(super) fn new(path: &Path, classifier: &Classifier, mains: Mains) -> Result<Self, Failure> {
        #[expect(clippy::cast_possible_truncation, reason = "a hop has 4 to 16 steps")]
        let fits = classifier.check_device(model::LABELS.split(' '), STEP_RATE_HZ, HOP as u8);
        let next = "fit it with this model as --artifact, or build with CORTICODE_ARTIFACT=FOLDER";
        fits.map_err(|error| Failure::check("the classifier", error, next))?;
        let next = "`host-sim inspect FILE` lists signals and events";
        let unusable = |error: &dyn std::fmt::Display| Failure::check("the recording", error, next);
        let played = Played::open(path, Missing::Interpolate).map_err(|error| unusable(&error))?;
        let trials = trials(&played, classifier, mains);
        if trials.is_empty() {
            let classes = classifier.decision.classes.iter();
            let classes: Vec<&str> = classes.map(|class| class.event.as_str()).collect();
            return Err(unusable(&format!("it has no event {}", classes.join(" or "))));
        }
        let mut failed = None;
        let samples = played.adc.map_while(|counts| {
            let counts = counts.map_err(|error| failed = Some(error)).ok()?;
            Some(first_channels(counts))
        });
        let features = features(samples, mains, classifier);
        match failed {
            Some(error) => Err(unusable(&error)),
            None => Ok(Self { trials, predictions: predictions(&features, classifier) }),
        }
    }
}

/// Returns a trial for each event that is the cue of a class. A trial ends with the hop at which
/// `trainer classify` decides.
fn trials(played: &Played, classifier: &Classifier, mains: Mains) -> Vec<Trial> {
    let delay_s = filter_delay_s(mains);
    let [from_s, to_s] = classifier.training.trial_s;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let hops = |duration_s: f64| (duration_s / seconds(HOP)).round() as usize;
    let events = played.onsets.seconds.iter().zip(&played.onsets.labels);
    let trials = events.filter_map(|(&cue_s, label)| {
        let name = label.name();
        let mut classes = classifier.decision.classes.iter();
        Some(Trial {
            class: classes.position(|class| class.event == name)?,
            cue_s,
            hop: hops(cue_s + delay_s + from_s) + hops(to_s - from_s),
            decision: None,
        })
    });
    trials.collect()
}
