//! Draws a closed loop: cues, probabilities and decisions over time.

use std::error::Error;
use std::path::Path;

use model::HOP;
use picture::axis::{Axis, Scale};
use picture::canvas::{FAINT, INK, REFERENCE, RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};

use super::{Outcome, Received};
use crate::Failure;
use crate::comparison::seconds;

/// Heights at which cues and decisions are drawn, above and below the probabilities.
const CUES: f64 = 1.12;
const DECISIONS: f64 = -0.12;

/// Draws an outcome into `folder`.
///
/// # Errors
/// The folder or a file cannot be written.
pub(super) fn draw(outcome: &Outcome, folder: &Path) -> Result<(), Failure> {
    let draw = || -> Result<(), Box<dyn Error>> {
        std::fs::create_dir_all(folder)?;
        Ok(chart(outcome).draw(&folder.join("loop.svg"))?)
    };
    let next = format!("is {} writable, and the disk not full?", folder.display());
    draw().map_err(|error| Failure::check("drawing the picture", error, &next))
}

/// Returns the chart of cues, probabilities and decisions.
fn chart(outcome: &Outcome) -> Lines {
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
        let points = points.map(|Received { hop, prediction, .. }| {
            (time_s(*hop), prediction.probabilities[index].into())
        });
        series.push(Series::new(&class.event, color, Mark::Line, points.collect()));
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
    // Label only one of the lines at the ends of trials, so that the legend lists them once.
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
