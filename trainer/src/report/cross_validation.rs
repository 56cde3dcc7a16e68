//! Part of the report on a cross-validation: errors of all folds.

use super::{MSE, Report};
use crate::crossval::{Outcome, Table, columns};
use crate::error::TrainerError;
use picture::axis::{Axis, Scale};
use picture::canvas::{RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};
use picture::page::csv_field;
use std::fmt::Write as _;

/// Largest number of folds whose names fit below a chart's axis.
const NAMED_FOLDS: usize = 12;
/// Distance on the axis between the points of one fold; neighbouring folds are 1 apart.
const APART: f64 = 0.15;

/// Adds the table and the picture of a cross-validation to a report.
pub(super) fn add(report: &mut Report, table: &Table) -> Result<(), TrainerError> {
    report.page.push_text(&format!(
        "Test error, mean ± standard deviation over the folds. {}.",
        table.settings()
    ));
    report.page.push_table(&figures(table));
    let folds = folds(table);
    report.add_picture(
        "folds",
        |path| folds.draw(path),
        "Test error of each fold, and at the end of each subject mean and standard deviation of its folds.",
        &folds_csv(table),
    )
}

fn figures(table: &Table) -> Vec<Vec<String>> {
    let head = ["subject", "folds", "model", "codes", "MSE", "MSE, uV²", "PRD, %"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(table.rows().iter().map(|row| row.cells().to_vec()));
    rows
}

/// Returns the outcomes, one slice for each subject.
fn subjects(table: &Table) -> Vec<&[Outcome]> {
    let outcomes = table.outcomes();
    outcomes.chunk_by(|a, b| a.subject == b.subject).collect()
}

/// Returns the chart of the test errors. Its axis has a position for each fold, for the mean of
/// each subject and, if there are several subjects, for the mean over all subjects.
fn folds(table: &Table) -> Lines {
    let subjects = subjects(table);
    let groups = subjects.len() + usize::from(subjects.len() > 1);
    let kinds = table.rows().len() / groups.max(1);
    let rows = table.rows()[..kinds].iter();
    let series = rows.map(|row| {
        let label = format!("{}, {} codes", row.model, row.codes);
        let is_pca = row.model.starts_with("PCA");
        let color = if is_pca { RESULT } else { SOURCE };
        let is_float = row.codes == "float";
        let mark = if is_float { Mark::Rings } else { Mark::Dots };
        Series::new(label, color, mark, Vec::new())
    });
    let mut series: Vec<Series> = series.collect();
    let mut add = |kind: usize, place: f64, mse: f64, sd: f64| {
        // The points of a fold are side by side: with three kinds, they are at -1, 0 and 1 times
        // `APART` from the position of the fold.
        let [kind_place, centre] =
            [kind, kinds - 1].map(|kind| f64::from(u32::try_from(kind).unwrap_or(0)));
        let x = place + APART * (kind_place - centre / 2.0);
        series[kind].points.push((x, mse));
        series[kind].sd.push(sd);
    };
    let mut axis = Axis::new("fold", Scale::Linear);
    let is_named = subjects.len() == 1 && table.outcomes().len() <= NAMED_FOLDS;
    let mut place = 0.0;
    for (group, rows) in table.rows().chunks(kinds.max(1)).enumerate() {
        let outcomes = subjects.get(group).copied().unwrap_or(&[]);
        let first = place;
        for outcome in outcomes {
            let columns = columns(outcome).into_iter();
            for (kind, errors) in columns.filter_map(|column| column.3).enumerate() {
                add(kind, place, errors.mse, 0.0);
            }
            if is_named {
                let name = format!("{}/{}", outcome.repetition, outcome.fold);
                axis.ticks.push((place, name));
            }
            place += 1.0;
        }
        for (kind, row) in rows.iter().enumerate() {
            add(kind, place, row.mse.mean, row.mse.sd);
        }
        if is_named {
            axis.ticks.push((place, "mean ± SD".to_owned()));
        } else {
            let subject = &rows[0].subject;
            axis.ticks.push((f64::midpoint(first, place), subject.clone()));
        }
        place += 2.0;
    }
    axis.label = if is_named {
        "repetition/fold".to_owned()
    } else {
        "subject: its folds, then mean ± SD".to_owned()
    };
    Lines {
        title: "Test error of each fold".to_owned(),
        subtitle: match subjects.as_slice() {
            [outcomes] => format!("subject {}, {} folds", outcomes[0].subject, outcomes.len()),
            several => format!("{} subjects, {} folds", several.len(), table.outcomes().len()),
        },
        x: axis,
        y: Axis::new(MSE, Scale::Linear),
        series,
    }
}

/// Returns the test errors as CSV: a line for each fold, model and kind of codes.
fn folds_csv(table: &Table) -> String {
    let mut text = "subject,repetition,fold,model,codes,mse,mse_uv2,prd_percent\n".to_owned();
    for outcome in table.outcomes() {
        for (model, codes, _, errors) in columns(outcome) {
            let Some(errors) = errors else {
                continue;
            };
            let _ = writeln!(
                text,
                "{},{},{},{model},{codes},{},{},{}",
                csv_field(&outcome.subject),
                outcome.repetition,
                outcome.fold,
                errors.mse,
                errors.mse_uv2,
                errors.prd_percent
            );
        }
    }
    text
}
