//! Part of a report: the learning curves of a training run.

use super::{MSE, Report};
use crate::error::TrainerError;
use crate::training::Learning;
use picture::axis::{Axis, Scale};
use picture::canvas::{FAINT, INK, RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};
use std::fmt::Write as _;

/// Adds the learning curves of a training run to a report, as a picture with its values.
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
        &csv(learning),
    )
}

fn lines(learning: &Learning) -> Lines {
    let Learning { curve, best_epoch, pca_validation } = learning;
    let validation = numbered(curve.validations(), 0);
    let best = usize::try_from(*best_epoch).ok();
    let best = best.and_then(|epoch| validation.get(epoch)).copied();
    let last = validation.last().map_or(0.0, |(epoch, _)| *epoch);
    let losses = numbered(curve.epochs.iter().map(|epoch| epoch.loss), 1);
    let validation_mse = best.map_or(f64::NAN, |(_, mse)| mse);
    Lines {
        title: "Learning curves".to_owned(),
        subtitle: format!(
            "validation MSE {validation_mse:.5} at epoch {best_epoch}, PCA {pca_validation:.5}"
        ),
        x: Axis::new("epoch", Scale::Whole),
        y: Axis::new(MSE, Scale::Logarithmic),
        series: vec![
            Series::new(
                "PCA, validation",
                RESULT,
                Mark::Line,
                vec![(0.0, *pca_validation), (last, *pca_validation)],
            ),
            Series::new("training loss", FAINT, Mark::Line, losses),
            Series::new("validation", SOURCE, Mark::Line, validation),
            Series::new(
                format!("chosen epoch: {best_epoch}"),
                INK,
                Mark::Rings,
                best.into_iter().collect(),
            ),
        ],
    }
}

/// Returns the points of a learning curve: each value with the number of its epoch, counted from
/// `first`.
fn numbered(values: impl Iterator<Item = f64>, first: u32) -> Vec<(f64, f64)> {
    (first..).map(f64::from).zip(values).collect()
}

/// Returns the values of the learning curves as CSV: a line for each epoch; epoch 0 has no training
/// loss.
fn csv(learning: &Learning) -> String {
    let (curve, pca) = (&learning.curve, learning.pca_validation);
    let losses = curve.epochs.iter().map(|epoch| epoch.loss.to_string());
    let losses = std::iter::once(String::new()).chain(losses);
    let mut text = "epoch,training_loss,validation_mse,validation_mse_pca\n".to_owned();
    for (epoch, (loss, validation)) in losses.zip(curve.validations()).enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{epoch},{loss},{validation},{pca}");
    }
    text
}
