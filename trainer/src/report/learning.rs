//! Learning curves of a training run.

use super::{MSE, Report};
use crate::error::TrainerError;
use crate::learning_curve::{Learning, LearningCurve};
use picture::axis::{Axis, Scale};
use picture::canvas::{FAINT, INK, RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};
use std::fmt::Write as _;

/// Adds the learning curves to a report.
pub(super) fn add(report: &mut Report, learning: &Learning) -> Result<(), TrainerError> {
    let lines = lines(learning);
    report.add_picture(
        "learning",
        |path| lines.draw(path),
        &format!(
            "Training loss and validation error after each epoch. Epoch 0 is the network before training. The model \
             has the parameters of epoch {}, whose validation error is the smallest.",
            learning.best_epoch
        ),
        &csv(&learning.curve, learning.pca_validation),
    )
}

fn lines(learning: &Learning) -> Lines {
    let Learning {
        curve,
        best_epoch,
        pca_validation,
    } = learning;
    let validation = numbered(curve.validations(), 0);
    let best = usize::try_from(*best_epoch).ok();
    let best = best.and_then(|epoch| validation.get(epoch)).copied();
    let last = validation.last().map_or(0.0, |(epoch, _)| *epoch);
    let series = |label: String, color, mark, points| Series {
        label,
        color,
        mark,
        points,
        sd: Vec::new(),
    };
    let validation_mse = best.map_or(f64::NAN, |(_, mse)| mse);
    Lines {
        title: "Learning curves".to_owned(),
        subtitle: format!(
            "validation MSE {validation_mse:.5} at epoch {best_epoch}, PCA {pca_validation:.5}"
        ),
        x: Axis::new("epoch", Scale::Whole),
        y: Axis::new(MSE, Scale::Logarithmic),
        series: vec![
            series(
                "PCA, validation".to_owned(),
                RESULT,
                Mark::Line,
                vec![(0.0, *pca_validation), (last, *pca_validation)],
            ),
            series(
                "training loss".to_owned(),
                FAINT,
                Mark::Line,
                numbered(curve.epochs.iter().map(|epoch| epoch.loss), 1),
            ),
            series("validation".to_owned(), SOURCE, Mark::Line, validation),
            series(
                format!("chosen epoch: {best_epoch}"),
                INK,
                Mark::Rings,
                best.into_iter().collect(),
            ),
        ],
    }
}

/// Returns values with their epochs, the first of which is `first`.
pub(super) fn numbered(values: impl Iterator<Item = f64>, first: u32) -> Vec<(f64, f64)> {
    (first..).map(f64::from).zip(values).collect()
}

/// Returns one line for each epoch; epoch 0 has no training loss.
fn csv(curve: &LearningCurve, pca_validation: f64) -> String {
    let mut text = "epoch,training_loss,validation_mse,validation_mse_pca\n".to_owned();
    let _ = writeln!(text, "0,,{},{pca_validation}", curve.initial_validation);
    for (epoch, losses) in (1..).zip(&curve.epochs) {
        let (loss, validation) = (losses.loss, losses.validation);
        let _ = writeln!(text, "{epoch},{loss},{validation},{pca_validation}");
    }
    text
}
