//! Draws a closed loop: cues, probabilities and decisions over time, and latencies.

use std::error::Error;
use std::path::Path;

use model::HOP;
use picture::axis::{Axis, Scale};
use picture::canvas::{FAINT, INK, REFERENCE, RESULT, SOURCE};
use picture::histogram::Histogram;
use picture::lines::{Lines, Mark, Series};

use super::{Outcome, Received, quantile};
use crate::Failure;
use crate::comparison::seconds;

/// Heights at which cues and decisions are drawn, above and below the probabilities.
const CUES: f64 = 1.12;
const DECISIONS: f64 = -0.12;
/// Number of bins of the latencies.
const BINS: u32 = 40;

/// Draws the pictures of an outcome into `folder`.
///
/// # Errors
/// The folder or a file cannot be written.
pub(super) fn draw_all(outcome: &Outcome, folder: &Path) -> Result<(), Failure> {
    let draw = || -> Result<(), Box<dyn Error>> {
        std::fs::create_dir_all(folder)?;
        probabilities(outcome).draw(&folder.join("probabilities.svg"))?;
        let latencies = outcome.latencies_ms();
        if let (Some(low), Some(high)) = (latencies.first(), latencies.last()) {
            histogram(&latencies, [low.min(0.0), high.max(low + 0.1)])
                .draw(&folder.join("latencies.svg"))?;
        }
        Ok(())
    };
    let next = format!("is {} writable, and the disk not full?", folder.display());
    draw().map_err(|error| Failure::check("drawing the pictures", error, &next))
}

/// Returns the chart of cues, probabilities and decisions.
fn probabilities(outcome: &Outcome) -> Lines {
    let [right, decided] = outcome.right_and_decided();
    let time_s = |hop: usize| seconds(hop * HOP);
    let [from_s, to_s] = outcome.classifier.training.trial_s;
    let (mut series, mut cues) = (Vec::new(), Vec::new());
    let colors = [SOURCE, RESULT, REFERENCE, INK].into_iter().cycle();
    let classes = outcome.classifier.decision.classes.iter();
    for ((index, class), color) in classes.enumerate().zip(colors) {
        let chosen = outcome.received.iter();
        let chosen = chosen.filter(|received| received.prediction.class == Some(index));
        let decisions = chosen.map(|received| (time_s(received.hop), DECISIONS));
        series.push(Series::new("", color, Mark::Dots, decisions.collect()));
        let points = outcome.received.iter();
        let points = points.map(
            |Received {
                 hop, prediction, ..
             }| { (time_s(*hop), prediction.probabilities[index].into()) },
        );
        series.push(Series::new(
            &class.event,
            color,
            Mark::Line,
            points.collect(),
        ));
        let own = outcome.trials.iter().filter(|trial| trial.class == index);
        cues.extend(own.map(|trial| {
            let ends = [0.0, to_s].map(|seconds| (trial.cue_s + seconds, CUES));
            Series::new("", color, Mark::Line, ends.to_vec())
        }));
    }
    let ends = outcome.trials.iter().map(|trial| {
        let line = [(time_s(trial.hop), -0.05), (time_s(trial.hop), 1.05)];
        Series::new("", FAINT, Mark::ThinLine, line.to_vec())
    });
    let mut series = ends.chain(series).chain(cues).collect::<Vec<_>>();
    // The legend lists one of the ends of trials.
    if let Some(end) = series.first_mut() {
        "decision of a trial".clone_into(&mut end.label);
    }
    let mut y = Axis::new("probability", Scale::Linear);
    y.ticks = vec![
        (DECISIONS, "decided".to_owned()),
        (0.0, "0".to_owned()),
        (0.5, "0.5".to_owned()),
        (1.0, "1".to_owned()),
        (CUES, "cue".to_owned()),
    ];
    Lines {
        title: "Cues, probabilities and decisions".to_owned(),
        subtitle: format!(
            "{}: {right} of {decided} trials right; decided from {from_s} to {to_s} s after the cue",
            outcome.recording
        ),
        x: Axis::new("time since the start of the recording (s)", Scale::Linear),
        y,
        series,
    }
}

/// Returns the histogram of sorted latencies, milliseconds.
fn histogram(latencies: &[f64], [low, high]: [f64; 2]) -> Histogram {
    let mut counts = vec![0; BINS as usize];
    for latency in latencies {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0..=BINS"
        )]
        let bin = ((latency - low) / (high - low) * f64::from(BINS)) as usize;
        counts[bin.min(BINS as usize - 1)] += 1;
    }
    let [half, most] = [0.5, 0.99].map(|part| quantile(latencies, part));
    Histogram {
        range: [low, high],
        counts,
        title: "From the last sample of a hop to its probability".to_owned(),
        subtitle: format!(
            "{} hops through PTY and bridge on this machine: median {half:.1} ms, 99 % within \
             {most:.1} ms",
            latencies.len()
        ),
        x: "latency (ms)".to_owned(),
    }
}
