//! Turns the features of each hop into the probability of each class.

use super::{Classifier, ClassifierError, DecisionRule};
use std::collections::VecDeque;

/// Number of levels per doubling of a feature's energy.
pub const LEVELS_PER_OCTAVE: u32 = 8;
/// Level that stands for an energy of 1.
pub const LEVEL_OF_ONE: i32 = -80;

/// Returns the energy that a level stands for.
pub fn energy(level: u8) -> f64 {
    (f64::from(i32::from(level) - LEVEL_OF_ONE) / f64::from(LEVELS_PER_OCTAVE)).exp2()
}

/// Returns the logarithm of each feature's mean energy over `hops`. Each hop is a slice with the
/// level of every feature.
pub fn log_energies<'a>(
    hops: &(impl Iterator<Item = &'a [u8]> + Clone),
    features: usize,
) -> Vec<f64> {
    #[expect(clippy::cast_precision_loss, reason = "a window has some hops")]
    let count = hops.clone().count() as f64;
    let features = (0..features).map(|feature| {
        let levels = hops.clone().filter_map(|levels| levels.get(feature));
        (levels.map(|&level| energy(level)).sum::<f64>() / count).ln()
    });
    features.collect()
}

/// Running decision of a classifier: averages the energies over a window of hops and returns the
/// probabilities of the classes.
#[derive(Clone, Debug)]
pub struct Decision {
    rule: DecisionRule,
    /// Levels of the newest hops, oldest first, at most as many as a window has; `None` for a hop
    /// without usable features.
    hops: VecDeque<Option<Vec<u8>>>,
    /// The newest probabilities.
    probabilities: Vec<f32>,
}

/// What a classifier decides at one hop.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Probability of each class, in the order of [`DecisionRule::classes`]; they sum to 1.
    pub probabilities: Vec<f32>,
    /// Whether the window is full, and at least half of its hops had usable features.
    pub is_settled: bool,
}

impl Prediction {
    /// Returns the index of the most probable class.
    pub fn class(&self) -> usize {
        let classes = self.probabilities.iter().enumerate();
        let best = classes.max_by(|a, b| a.1.total_cmp(b.1));
        best.map_or(0, |(index, _)| index)
    }
}

impl Decision {
    /// Creates a decision with an empty window, in which all classes are equally probable.
    pub fn new(classifier: &Classifier) -> Self {
        let rule = classifier.decision.clone();
        let classes = rule.classes.len();
        #[expect(clippy::cast_precision_loss, reason = "a few classes")]
        let equal = 1.0 / classes as f32;
        Self { rule, hops: VecDeque::new(), probabilities: vec![equal; classes] }
    }

    /// Adds a hop's levels, one for each filter, and returns the decision. Excess levels are
    /// ignored; a missing level adds nothing to the scores.
    pub fn add_hop(&mut self, levels: &[u8]) -> Prediction {
        self.push(Some(levels.to_vec()));
        let usable = self.hops.iter().flatten().map(Vec::as_slice);
        let count = usable.clone().count();
        let features = log_energies(&usable, levels.len());
        self.probabilities = self.rule.probabilities(&features);
        let window = self.rule.window_hops as usize;
        Prediction {
            probabilities: self.probabilities.clone(),
            is_settled: self.hops.len() == window && 2 * count >= window,
        }
    }

    /// Adds a hop whose features are missing or unusable. The probabilities stay as they are.
    pub fn skip_hop(&mut self) {
        self.push(None);
    }

    /// Returns the newest probability of each class.
    pub fn probabilities(&self) -> &[f32] {
        &self.probabilities
    }

    fn push(&mut self, hop: Option<Vec<u8>>) {
        while self.hops.len() >= self.rule.window_hops as usize {
            self.hops.pop_front();
        }
        self.hops.push_back(hop);
    }
}

impl DecisionRule {
    /// Returns the score of each class. `features` holds `ln(energy)` of each feature.
    pub fn scores(&self, features: &[f64]) -> Vec<f64> {
        let classes = self.weights.iter().zip(&self.bias);
        let score = |(weights, bias): (&Vec<f64>, &f64)| {
            let terms = weights.iter().zip(features).map(|(w, x)| w * x);
            bias + terms.sum::<f64>()
        };
        classes.map(score).collect()
    }

    /// Returns the probability of each class: the softmax of the [`Self::scores`].
    pub fn probabilities(&self, features: &[f64]) -> Vec<f32> {
        let scores = self.scores(features);
        let largest = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let terms: Vec<f64> = scores.iter().map(|score| (score - largest).exp()).collect();
        let sum: f64 = terms.iter().sum();
        #[expect(clippy::cast_possible_truncation, reason = "a probability")]
        let probability = |term: &f64| (term / sum) as f32;
        terms.iter().map(probability).collect()
    }
}

impl Classifier {
    /// Checks that a device has the montage and the rates that the classifier was trained with.
    ///
    /// # Errors
    /// [`ClassifierError::Device`] if the montage or a rate differs.
    pub fn check_device<'a>(
        &self,
        labels: impl Iterator<Item = &'a str>,
        step_rate_hz: u16,
        hop_steps: u8,
    ) -> Result<(), ClassifierError> {
        let rates = |rate: u16, hop: u8| format!("{rate} steps per second in hops of {hop}");
        let electrodes = |labels: &[&str]| format!("the electrodes {}", labels.join(" "));
        let labels: Vec<_> = labels.collect();
        let own: Vec<_> = self.electrodes.iter().map(String::as_str).collect();
        let (expected, found) = if labels != own {
            (electrodes(&own), electrodes(&labels))
        } else if (step_rate_hz, hop_steps) != (self.step_rate_hz, self.hop_steps) {
            let own = rates(self.step_rate_hz, self.hop_steps);
            (own, rates(step_rate_hz, hop_steps))
        } else {
            return Ok(());
        };
        Err(ClassifierError::Device { expected, found })
    }
}
