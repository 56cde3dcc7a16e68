//! Tests classifiers on synthetic trials: sources with known patterns, comparison with numpy, and
//! random guesses.

use super::figures::{Part, figures};
use super::validation::{cross_validate, decide_sessions, folds};
use super::*;
use crate::card::{self, Shape};
use crate::testing;
use artifact::classifier::ClassifierFigures;
use artifact::{CodeFormat, Mode, MontageFile, Padding};
use clap::Parser as _;
use nalgebra::DMatrix;
use packed_fit::Track;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Patterns of two sources over eight electrodes: the first is strong in class 0, the second in
/// class 1.
const PATTERNS: [[f32; 8]; 2] =
    [[0.1, 0.0, 1.0, 0.2, 0.4, 0.0, 0.1, -0.1], [0.0, 0.1, 0.2, 1.0, 0.0, -0.5, 0.0, 0.1]];
/// Seconds from one event to the next.
const PERIOD_S: usize = 5;

#[derive(clap::Parser)]
struct Cli {
    #[command(flatten)]
    options: ClassifyOptions,
}

/// Figures as the command prints them.
struct Text<'a>(&'a ClassifierFigures);

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        super::figures::write(f, "title", &["T1", "T2"], self.0)
    }
}

fn plan(more: &str) -> Result<Plan, TrainerError> {
    let options = "trainer --train=x --mains=50 --out=x --events=T1=769,T2=770";
    let options = Cli::parse_from(options.split(' ').chain(more.split_whitespace())).options;
    let shape = Shape {
        mode: Mode::Packed,
        numbers: 0,
        steps: 16,
        hop: 8,
        padding: Padding::None,
        format: CodeFormat::Int8,
    };
    let text = include_str!("../../../files/montages/cyton-8.toml");
    let montage = MontageFile::parse(Path::new("cyton-8.toml"), text).expect("a montage");
    let ClassifyOptions { events, task, filters, window, .. } = &options;
    let description = card::description(&montage, shape);
    Plan::new(events, task, *filters, *window, &description)
}

/// Returns a session of `trials` trials. In each trial, the source of the trial's class is
/// `contrast` times as large as the other source.
fn session(plan: &Plan, seed: u64, trials: usize, contrast: f32) -> Session {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let classes: Vec<usize> = (0..trials).map(|n| (n * n / 3) % 2).collect();
    let steps = (0..(trials + 1) * PERIOD_S * 128).flat_map(|step| {
        let class = classes.get(step / (PERIOD_S * 128)).copied().unwrap_or(0);
        let amplitude = [0, 1].map(|source| if source == class { 10.0 * contrast } else { 10.0 });
        let [a, b] = amplitude.map(|most: f32| rng.random_range(-most..most));
        let mut noise = || rng.random_range(-4.0..4.0);
        PATTERNS[0]
            .iter()
            .zip(PATTERNS[1])
            .map(|(p, q)| p * a + q * b + noise())
            .collect::<Vec<_>>()
    });
    let track = Track::new("synthetic", 8, steps.collect());
    let events = classes.iter().enumerate();
    let events: Vec<_> = events.map(|(n, &class)| ((n * PERIOD_S) as f64, class)).collect();
    Session::new(track, &events, plan)
}

fn pairs(sessions: &[Session]) -> Vec<(&Session, &sessions::Trial)> {
    sessions.iter().flat_map(Session::with_trials).collect()
}

/// Returns the output of `reference.py` for sessions; `None` without numpy.
fn numpy(sessions: &[Session]) -> Option<Json> {
    let trials = sessions.iter().enumerate().flat_map(|(index, session)| {
        session.trials.iter().map(move |trial| {
            let hops = &trial.windows[0].hops;
            json!([index, hops.start * 8, hops.end * 8, trial.class])
        })
    });
    let trials = trials.collect::<Json>().to_string();
    let tracks = sessions.iter().map(|session| &session.track);
    testing::numpy("classifier", include_str!("reference.py"), &[trials], tracks)
}

#[test]
fn sources_of_known_patterns_are_found_and_decide() {
    let plan = plan("").expect("a plan");
    let sessions = [1, 2, 3].map(|seed| session(&plan, seed, 12, 1.6));
    let fitted = fit::fit(&plan, &pairs(&sessions)).expect("a fit");
    for (filter, expected) in [(0, PATTERNS[0]), (3, PATTERNS[1])] {
        let pattern = &fitted.classifier.filters[filter].pattern;
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        let norms = (dot(pattern, pattern) * dot(&expected, &expected)).sqrt();
        assert!(dot(pattern, &expected) / norms > 0.97, "{pattern:?}");
    }
    let (figures, courses) = cross_validate(&plan, &sessions, &folds(&sessions)).expect("a fit");
    assert!(figures.accuracy > 0.85 && figures.auc > 0.95, "{figures:?}");
    assert!((figures.auc - figures.auc_float).abs() < 0.01, "{figures:?}");
    assert_eq!(figures.parts.len(), 3);
    // The probability rises within the trial, which ends at 4 s.
    let [before, end] = [0.0, 4.0].map(|seconds| {
        let near = courses[0].iter().min_by(|a, b| {
            let distance = |at: &(f64, f64)| (at.0 - seconds).abs();
            distance(a).total_cmp(&distance(b))
        });
        near.expect("a course").1
    });
    assert!(end > 0.95 && before < 0.75, "{before} {end}");

    let Some(numpy) = numpy(&sessions) else {
        return;
    };
    let numbers = |value: &Json| -> Vec<f64> {
        let values = value.as_array().expect("an array").iter();
        values.map(|value| value.as_f64().expect("a number")).collect()
    };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * (1.0 + b.abs());
    for (filter, expected) in fitted.filters.column_iter().zip(0..) {
        let expected = numbers(&numpy["filters"][expected]);
        let expected = DMatrix::from_column_slice(8, 1, &expected);
        let sign = filter.dot(&expected).signum();
        assert!((filter - expected * sign).amax() < 1e-6 * filter.amax(), "{filter}");
    }
    let rule = &fitted.float_rule;
    let weights = numbers(&numpy["weights"]);
    for (feature, expected) in weights.into_iter().enumerate() {
        let difference = rule.weights[1][feature] - rule.weights[0][feature];
        assert!(near(difference, expected), "{difference} {expected}");
    }
    let bias = rule.bias[1] - rule.bias[0];
    assert!(near(bias, numpy["bias"].as_f64().expect("a number")), "{bias} {numpy}");
}

#[test]
fn trials_without_a_difference_are_called_guesses_and_a_single_recording_is_divided() {
    let plan = plan("--window=1").expect("a plan");
    let sessions = [session(&plan, 4, 24, 1.0)];
    let folds = folds(&sessions);
    assert_eq!(folds.len(), 5);
    let (figures, _) = cross_validate(&plan, &sessions, &folds).expect("a fit");
    assert_eq!(figures.parts.iter().map(|part| part.trials).sum::<u32>(), 24);
    assert!(Text(&figures).to_string().contains("not better than guessing"), "{figures:?}");
    // A classifier of one session decides on another session at every hop, averaging over one
    // second.
    let fitted = fit::fit(&plan, &pairs(&sessions)).expect("a fit");
    assert_eq!(fitted.classifier.decision.window_hops, 16);
    assert_eq!(decide_sessions(&fitted, &[session(&plan, 5, 12, 1.0)])[0].decided.len(), 12);
}

#[test]
fn figures_of_a_few_decisions_are_those_computed_by_hand() {
    let decided = |class, scores: [f64; 2]| super::figures::Decided {
        class,
        decision: usize::from(scores[1] > scores[0]),
        scores: scores.to_vec(),
        float_scores: scores.iter().map(|score| -score).collect(),
    };
    let part = Part {
        name: "run".to_owned(),
        decided: vec![
            decided(0, [1.0, 0.0]),
            decided(0, [0.0, 1.0]),
            decided(1, [0.0, 2.0]),
            decided(1, [0.0, 1.0]),
        ],
    };
    let figures = figures(&[part], 2);
    assert_eq!(figures.confusion, [[1, 1], [0, 2]]);
    // Of the four pairs of trials of different classes, three are ordered correctly and one is a
    // tie.
    assert!((figures.auc - 0.875).abs() < 1e-9 && (figures.auc_float - 0.125).abs() < 1e-9);
    // statsmodels.stats.proportion.proportion_confint(3, 4, method="wilson")
    let [low, high] = figures.accuracy_95;
    assert!((low - 0.300_642).abs() < 2e-6 && (high - 0.954_413).abs() < 2e-6, "{low} {high}");
    // Each class has two trials; the decisions are one for the first class and three for the
    // second.
    assert!((chance(&figures) - 0.5).abs() < 1e-9);
}
