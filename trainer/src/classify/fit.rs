//! Fits the spatial filters and the decision rule of a classifier to trials.

use super::options::TaskOptions;
use super::sessions::{Session, Trial};
use crate::error::TrainerError;
use artifact::Description;
use artifact::classifier::{
    Band, Class, Classifier, ClassifierTraining, DecisionRule, LARGEST_ROW, MAX_FEATURES,
    SpatialFilter, log_energies,
};
use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use packed_fit::band_pass::band_passed;
use packed_fit::{FitError, Track, features};
use std::ops::Range;

/// Default number of filters, before rounding down to a multiple of the number of classes. With
/// more classes than this, the default is one filter for each class.
const FILTERS: usize = 6;
/// Fraction of a class's covariance that is replaced by white noise of the same power.
const SHRINKAGE: f64 = 0.01;
/// Smallest permitted number of trials of a class.
const LEAST_TRIALS: usize = 10;

/// The classifier to be fitted, still empty, and the position and length of its trials.
pub(super) struct Plan {
    /// The classifier without filters and weights.
    empty: Classifier,
    filters_per_class: usize,
    trial_s: [f64; 2],
    /// Length of a trial in hops.
    trial_hops: usize,
}

/// A classifier, with its filters and decision rule in floating point.
pub(super) struct Fitted {
    pub(super) classifier: Classifier,
    /// Float filters, `[electrode, filter]`.
    pub(super) filters: DMatrix<f64>,
    pub(super) float_rule: DecisionRule,
}

impl Plan {
    /// Checks the options. `None` for `filters` or `window_s` selects the default.
    ///
    /// # Errors
    /// If there are fewer than two classes, two classes have the same event or code, the filters
    /// cannot be divided among the classes, or the window is not between one hop and the length of
    /// a trial.
    pub(super) fn new(
        classes: &[Class],
        task: &TaskOptions,
        filters: Option<usize>,
        window_s: Option<f64>,
        description: &Description,
    ) -> Result<Self, TrainerError> {
        let classes = classes.to_vec();
        let count = classes.len();
        let is_repeated = |(index, class): (usize, &Class)| {
            let mut before = classes[..index].iter();
            before.any(|other| other.code == class.code || other.event == class.event)
        };
        if count < 2 || classes.iter().enumerate().any(is_repeated) {
            return Err(TrainerError::Classes);
        }
        let filters = filters.unwrap_or(FILTERS.max(count) / count * count);
        if filters == 0 || filters > MAX_FEATURES || !filters.is_multiple_of(count) {
            let classes = count;
            return Err(TrainerError::Filters { filters, classes });
        }
        let window = &description.window;
        let hops_per_s = f64::from(window.rate_hz) / window.hop as f64;
        let [from_s, to_s] = task.trial;
        let window_s = window_s.unwrap_or(to_s - from_s);
        let hops = [to_s - from_s, window_s].map(|seconds| whole((seconds * hops_per_s).round()));
        let [trial_hops, window_hops] = hops;
        if !(1..=trial_hops).contains(&window_hops) {
            let trial_s = to_s - from_s;
            return Err(TrainerError::DecisionWindow { window_s, trial_s });
        }
        let narrow = |number: usize| u8::try_from(number).expect("a hop has 4 to 16 steps");
        Ok(Self {
            empty: Classifier {
                format: 1,
                electrodes: description.montage.electrodes.clone(),
                step_rate_hz: u16::try_from(window.rate_hz).expect("always 128"),
                hop_steps: narrow(window.hop),
                band: Band {
                    hz: task.band,
                    sections: model_gen::band_power_sections(task.band, f64::from(window.rate_hz)),
                },
                decision: DecisionRule {
                    classes,
                    window_hops: u32::try_from(window_hops).unwrap_or(u32::MAX),
                    weights: Vec::new(),
                    bias: Vec::new(),
                },
                filters: Vec::new(),
                training: ClassifierTraining::default(),
            },
            filters_per_class: filters / count,
            trial_s: task.trial,
            trial_hops,
        })
    }

    pub(super) fn classes(&self) -> &[Class] {
        &self.empty.decision.classes
    }

    /// Returns the number of steps of a hop.
    pub(super) fn hop(&self) -> usize {
        self.empty.hop_steps.into()
    }

    pub(super) fn step_rate_hz(&self) -> f64 {
        f64::from(self.empty.step_rate_hz)
    }

    /// Returns the duration of a hop, seconds.
    pub(super) fn hop_s(&self) -> f64 {
        self.hop() as f64 / self.step_rate_hz()
    }

    /// Returns the end of a trial, seconds after its event.
    pub(super) fn end_s(&self) -> f64 {
        self.trial_s[1]
    }

    /// Returns the windows of a trial, as ranges of hops: the smallest number of evenly spaced
    /// windows that covers the trial. The event is `seconds` after the start of a session of `hops`
    /// hops. `None` if the trial extends beyond the session.
    pub(super) fn windows(&self, seconds: f64, hops: usize) -> Option<Vec<Range<usize>>> {
        let first = ((seconds + self.trial_s[0]) / self.hop_s()).round();
        let first = (first >= 0.0).then(|| whole(first))?;
        if first.saturating_add(self.trial_hops) > hops {
            return None;
        }
        let window = self.empty.decision.window_hops as usize;
        let count = self.trial_hops.div_ceil(window);
        let spare = self.trial_hops - window;
        let start = |index: usize| first + index * spare / (count - 1).max(1);
        Some((0..count).map(start).map(|start| start..start + window).collect())
    }

    /// Returns the band-passed electrodes in microvolts, `[electrode, step]`.
    pub(super) fn band_passed(&self, track: &Track) -> DMatrix<f64> {
        band_passed(track, &self.empty.band.sections)
    }

    /// Returns the number of trials of each class.
    pub(super) fn counts(&self, sessions: &[Session]) -> Vec<u32> {
        let mut counts = vec![0; self.classes().len()];
        for trial in sessions.iter().flat_map(|session| &session.trials) {
            counts[trial.class] += 1;
        }
        counts
    }

    /// Refuses training recordings with too few trials of a class.
    pub(super) fn check_trials(&self, sessions: &[Session]) -> Result<(), TrainerError> {
        for (class, count) in self.classes().iter().zip(self.counts(sessions)) {
            if (count as usize) < LEAST_TRIALS {
                return Err(TrainerError::TooFewTrials {
                    event: class.event.clone(),
                    count,
                    needed: LEAST_TRIALS,
                });
            }
        }
        Ok(())
    }
}

/// Fits the spatial filters, and the decision rule that reads their band powers, to trials.
///
/// # Errors
/// If trials of a class are missing, or no device could run the filters.
pub(super) fn fit(plan: &Plan, trials: &[(&Session, &Trial)]) -> Result<Fitted, TrainerError> {
    let means = mean_covariances(plan, trials)?;
    let filters =
        common_spatial_patterns(&means, plan.filters_per_class).ok_or(FitError::Silent)?;
    let covariance = means.iter().sum::<DMatrix<f64>>();
    let mut classifier = plan.empty.clone();
    for filter in filters.column_iter() {
        let pattern = &covariance * filter;
        let largest = pattern[pattern.iamax()];
        let (pattern, filter) = (pattern / largest, filter * largest.signum());
        #[expect(clippy::cast_possible_truncation, reason = "-1 to 1")]
        let pattern = pattern.iter().map(|part| *part as f32).collect();
        let weights = int8_weights(&filter);
        classifier.filters.push(SpatialFilter { weights, pattern });
    }
    let (mut features, mut float_features) = (Vec::new(), Vec::new());
    // Trials of a session are consecutive, so the session's levels are computed once.
    for trials in trials.chunk_by(|(a, _), (b, _)| std::ptr::eq(*a, *b)) {
        let levels = features::levels(&trials[0].0.track, &classifier);
        for (_, trial) in trials {
            for window in &trial.windows {
                let hops = levels[window.hops.clone()].iter().map(Vec::as_slice);
                features.push((trial.class, log_energies(&hops, classifier.filters.len())));
                float_features.push((trial.class, log_powers(&filters, &window.moment)));
            }
        }
    }
    discriminant(&mut classifier.decision, &features);
    let mut float_rule = classifier.decision.clone();
    discriminant(&mut float_rule, &float_features);
    // Write the classifier as text and parse it, which checks all ranges.
    let classifier = Classifier::parse(&classifier.to_toml()?)?;
    Ok(Fitted { classifier, filters, float_rule })
}

impl Fitted {
    /// Returns the score of each class for the last window of a trial, without quantisation.
    pub(super) fn float_scores(&self, trial: &Trial) -> Vec<f64> {
        let last = trial.windows.last().map(|window| log_powers(&self.filters, &window.moment));
        self.float_rule.scores(&last.unwrap_or_default())
    }
}

/// Returns each class's mean covariance: the mean of its trials' second moments, each divided by
/// its trace. The mean is shrunk by [`SHRINKAGE`].
fn mean_covariances(
    plan: &Plan,
    trials: &[(&Session, &Trial)],
) -> Result<Vec<DMatrix<f64>>, TrainerError> {
    let electrodes = plan.empty.electrodes.len();
    let of_class = |(index, class): (usize, &Class)| {
        let mut sum = DMatrix::zeros(electrodes, electrodes);
        let mut count = 0_u32;
        for (_, trial) in trials.iter().filter(|(_, trial)| trial.class == index) {
            let moment: DMatrix<f64> = trial.windows.iter().map(|window| &window.moment).sum();
            let trace = moment.trace().max(f64::MIN_POSITIVE);
            sum += moment / trace;
            count += 1;
        }
        if count < 2 {
            return Err(TrainerError::UnevenTrials(class.event.clone()));
        }
        Ok(shrunk(sum / f64::from(count)))
    };
    plan.classes().iter().enumerate().map(of_class).collect()
}

/// Returns a covariance with the fraction [`SHRINKAGE`] replaced by white noise of the same power.
pub(super) fn shrunk(covariance: DMatrix<f64>) -> DMatrix<f64> {
    let electrodes = covariance.nrows();
    let noise = SHRINKAGE * covariance.trace() / electrodes as f64;
    covariance * (1.0 - SHRINKAGE) + DMatrix::identity(electrodes, electrodes) * noise
}

/// Returns common spatial patterns, `[electrode, filter]`: for each class in turn, the `count`
/// filters with the largest ratio of power in the class's trials to power in all classes' trials.
/// `None` if the covariances are not positive definite.
pub(super) fn common_spatial_patterns(
    means: &[DMatrix<f64>],
    count: usize,
) -> Option<DMatrix<f64>> {
    let mut filters: Vec<DVector<f64>> = Vec::new();
    for (class, own) in means.iter().enumerate() {
        let others = means.iter().enumerate().filter(|(other, _)| *other != class);
        let others: DMatrix<f64> = others.map(|(_, mean)| mean).sum();
        let both = own + others / (means.len() - 1) as f64;
        // own w = lambda both w, with both = L L^T and w = L^-T v.
        let lower = Cholesky::new(both)?.unpack();
        let half = lower.solve_lower_triangular(own)?;
        let whitened = lower.solve_lower_triangular(&half.transpose())?;
        let eigen = SymmetricEigen::new((&whitened + whitened.transpose()) / 2.0);
        let mut order: Vec<usize> = (0..own.nrows()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        for index in order.into_iter().take(count) {
            let vector = eigen.eigenvectors.column(index).into_owned();
            filters.push(lower.tr_solve_lower_triangular(&vector)?);
        }
    }
    Some(DMatrix::from_columns(&filters))
}

/// Returns a filter in int8, scaled to the largest weights that a device accepts.
fn int8_weights(filter: &DVector<f64>) -> Vec<i8> {
    // Leave room for rounding, which adds at most one half to each magnitude.
    let sum = f64::from(LARGEST_ROW) - filter.len() as f64 / 2.0;
    let scale = (127.0 / filter.amax()).min(sum / filter.lp_norm(1));
    #[expect(clippy::cast_possible_truncation, reason = "-127 to 127")]
    let weights = filter.iter().map(|weight| (weight * scale).round() as i8);
    weights.collect()
}

/// Returns the logarithm of the power of each filter's signal.
fn log_powers(filters: &DMatrix<f64>, moment: &DMatrix<f64>) -> Vec<f64> {
    let powers = filters.column_iter().map(|filter| filter.dot(&(moment * filter)));
    powers.map(|power| power.max(f64::MIN_POSITIVE).ln()).collect()
}

/// Fits a linear discriminant to features and their classes, with equal prior probabilities. The
/// classes share a covariance, which is shrunk as in Ledoit and Wolf (2004).
fn discriminant(rule: &mut DecisionRule, features: &[(usize, Vec<f64>)]) {
    let size = features.first().map_or(0, |(_, x)| x.len());
    let means = (0..rule.classes.len()).map(|class| {
        let own: Vec<_> = features.iter().filter(|(of, _)| *of == class).collect();
        let sum = own.iter().map(|(_, x)| DVector::from_column_slice(x)).sum::<DVector<f64>>();
        sum / own.len() as f64
    });
    let means: Vec<DVector<f64>> = means.collect();
    let residuals =
        features.iter().map(|(class, x)| DVector::from_column_slice(x) - &means[*class]);
    let residuals = DMatrix::from_columns(&residuals.collect::<Vec<_>>());
    let inverse = shrunk_covariance(&residuals)
        .try_inverse()
        .unwrap_or_else(|| DMatrix::identity(size, size));
    let weights: Vec<DVector<f64>> = means.iter().map(|mean| &inverse * mean).collect();
    let biases = means.iter().zip(&weights);
    let biases: Vec<f64> = biases.map(|(mean, w)| -0.5 * mean.dot(w)).collect();
    // Subtract the mean over the classes: only differences between the classes' scores matter.
    let classes = means.len() as f64;
    let common = weights.iter().sum::<DVector<f64>>() / classes;
    let common_bias = biases.iter().sum::<f64>() / classes;
    let weights = weights.iter().map(|weights| weights - &common);
    rule.weights = weights.map(|weights| weights.iter().copied().collect()).collect();
    rule.bias = biases.iter().map(|bias| bias - common_bias).collect();
}

/// Returns the covariance of centred columns, shrunk towards a multiple of the identity.
fn shrunk_covariance(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let (size, count) = (columns.nrows() as f64, columns.ncols() as f64);
    let covariance = columns * columns.transpose() / count;
    let mean = covariance.trace() / size;
    let target = DMatrix::identity(columns.nrows(), columns.nrows()) * mean;
    let distance = (&covariance - &target).norm_squared();
    let fourth: f64 = columns.column_iter().map(|x| x.norm_squared().powi(2)).sum();
    let error = (fourth / count - covariance.norm_squared()) / count;
    let shrinkage = if distance > 0.0 { (error / distance).clamp(0.0, 1.0) } else { 1.0 };
    covariance * (1.0 - shrinkage) + target * shrinkage
}

/// Converts a whole number to an index; negative numbers become 0.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(number: f64) -> usize {
    number as usize
}
