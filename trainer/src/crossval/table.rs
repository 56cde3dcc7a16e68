//! The table of a cross-validation: mean and standard deviation over the folds of each subject.

use super::outcome::Outcome;
use crate::error::TrainerError;
use crate::evaluate::ReconstructionError;
use picture::page::csv_field;
use serde::Serialize;
use std::fmt::{self, Write};
use std::fs;
use std::path::Path;

/// Outcomes of all folds, and their means and deviations.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    outcomes: Vec<Outcome>,
    rows: Vec<Row>,
}

/// Errors of one kind of code over the folds of a subject, or over all subjects.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Row {
    /// Name of the subject; `all` for the mean over the subjects' means.
    pub(crate) subject: String,
    /// Number of folds over all repetitions; for `all`, number of subjects.
    pub(crate) folds: usize,
    /// Mode of the model, or PCA with the number of its components.
    pub(crate) model: String,
    /// Kind of the codes, `float` or `integer`.
    pub(crate) codes: &'static str,
    /// Whether the signal can be decoded from the code alone.
    is_decodable: bool,
    /// Mean squared error, in units of the training variance.
    pub(crate) mse: Spread,
    /// Mean squared error, uV^2.
    pub(crate) mse_uv2: Spread,
    /// Root of the sum of squared errors divided by root of the sum of squared values, percent.
    pub(crate) prd_percent: Spread,
}

impl Row {
    /// Returns the cells of the printed row: subject, folds, model, codes, and mean and deviation
    /// of the three errors.
    pub(crate) fn cells(&self) -> [String; 7] {
        let spread =
            |Spread { mean, sd }: Spread, digits| format!("{mean:.digits$} ± {sd:.digits$}");
        [
            self.subject.clone(),
            self.folds.to_string(),
            self.model.clone(),
            self.codes.to_owned(),
            spread(self.mse, 5),
            spread(self.mse_uv2, 2),
            spread(self.prd_percent, 2),
        ]
    }
}

/// Mean and sample standard deviation of an error, over folds or subjects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Spread {
    pub(crate) mean: f64,
    pub(crate) sd: f64,
}

/// Number of errors of an outcome: of the model and of PCA, each with float and integer codes.
const COLUMNS: usize = 4;

impl Table {
    /// Makes the table from the outcomes of all folds, sorted by subject, repetition and fold.
    pub(super) fn new(outcomes: Vec<Outcome>) -> Self {
        let mut rows = Vec::new();
        for subject in outcomes.chunk_by(|a, b| a.subject == b.subject) {
            rows.extend(rows_of(subject));
        }
        rows.extend(over_subjects(&rows));
        Self { outcomes, rows }
    }

    /// Returns the outcomes, sorted by subject, repetition and fold.
    pub(crate) fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// Returns the settings of the first fold's model as text: montage, shape and training.
    pub(crate) fn settings(&self) -> &str {
        self.outcomes.first().map_or("", |outcome| outcome.settings.as_str())
    }

    /// Returns the rows of each subject in turn, followed by the rows over all subjects if there
    /// are several.
    pub(crate) fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// Writes `table.md`, `table.csv` and `table.json` to a folder. The files depend only on the
    /// outcomes.
    pub(super) fn write(&self, folder: &Path) -> Result<(), TrainerError> {
        let json = serde_json::json!({
            "settings": self.outcomes.first().map(|outcome| &outcome.settings),
            "rows": self.rows,
            "folds": self.outcomes,
        });
        for (name, text) in [
            ("table.md", self.to_string()),
            ("table.csv", self.csv()),
            ("table.json", format!("{json:#}\n")),
        ] {
            let path = folder.join(name);
            fs::write(&path, text).map_err(TrainerError::file(&path))?;
        }
        Ok(())
    }

    fn csv(&self) -> String {
        let mut text =
            "subject,folds,model,codes,decodable,mse_mean,mse_sd,mse_uv2_mean,mse_uv2_sd,\
                        prd_percent_mean,prd_percent_sd\n"
                .to_owned();
        for row in &self.rows {
            let Row { subject, folds, model, codes, is_decodable, mse, mse_uv2, prd_percent } = row;
            let subject = csv_field(subject);
            let _ = write!(text, "{subject},{folds},{model},{codes},{is_decodable}");
            for Spread { mean, sd } in [mse, mse_uv2, prd_percent] {
                let _ = write!(text, ",{mean},{sd}");
            }
            text.push('\n');
        }
        text
    }
}

impl fmt::Display for Table {
    /// Writes the table as Markdown.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| Subject | Folds | Model | Codes | From the code alone | MSE | MSE uV^2 | PRD % |"
        )?;
        writeln!(f, "| --- | ---: | --- | --- | --- | ---: | ---: | ---: |")?;
        for row in &self.rows {
            let [subject, folds, model, codes, errors @ ..] = row.cells();
            let decodable = if row.is_decodable { "yes" } else { "no" };
            let errors = errors.join(" | ");
            writeln!(f, "| {subject} | {folds} | {model} | {codes} | {decodable} | {errors} |")?;
        }
        let Some(outcome) = self.outcomes.first() else {
            return Ok(());
        };
        writeln!(f, "\nTest error, mean ± standard deviation over the folds. {}.", outcome.settings)
    }
}

/// Returns the four errors of an outcome, each with the model, the kind of codes, and whether the
/// signal can be decoded from the code alone. In mode `pca` the model's own errors are `None`,
/// because they would equal the errors of PCA.
pub(crate) fn columns(
    outcome: &Outcome,
) -> [(String, &'static str, bool, Option<ReconstructionError>); COLUMNS] {
    let (mode, pca) = (&outcome.mode, format!("PCA-{}", outcome.numbers));
    let model = |codes, errors: Option<ReconstructionError>| {
        let errors = errors.filter(|_| mode != "pca");
        (mode.clone(), codes, outcome.is_decodable, errors)
    };
    [
        model("float", outcome.model_float),
        model("integer", outcome.model_integer),
        (pca.clone(), "float", true, Some(outcome.pca_float)),
        (pca, "integer", true, Some(outcome.pca_integer)),
    ]
}

/// Returns the rows of one subject, from the outcomes of its folds.
fn rows_of(outcomes: &[Outcome]) -> Vec<Row> {
    let columns: Vec<_> = outcomes.iter().map(columns).collect();
    let rows = (0..COLUMNS).filter_map(|at| {
        let (model, codes, is_decodable, _) = columns.first()?[at].clone();
        let errors: Vec<ReconstructionError> =
            columns.iter().filter_map(|column| column[at].3).collect();
        let spread =
            |figure: fn(&ReconstructionError) -> f64| Spread::new(errors.iter().map(figure));
        (!errors.is_empty()).then(|| Row {
            subject: outcomes[0].subject.clone(),
            folds: errors.len(),
            model,
            codes,
            is_decodable,
            mse: spread(|errors| errors.mse),
            mse_uv2: spread(|errors| errors.mse_uv2),
            prd_percent: spread(|errors| errors.prd_percent),
        })
    });
    rows.collect()
}

/// Returns the rows with the means over all subjects; none if there is only one subject.
fn over_subjects(rows: &[Row]) -> Vec<Row> {
    let Some(first) = rows.first() else {
        return Vec::new();
    };
    let kinds = rows.iter().take_while(|row| row.subject == first.subject);
    if rows.iter().all(|row| row.subject == first.subject) {
        return Vec::new();
    }
    kinds
        .map(|kind| {
            let same: Vec<&Row> = rows
                .iter()
                .filter(|row| row.model == kind.model && row.codes == kind.codes)
                .collect();
            let spread = |figure: fn(&Row) -> f64| Spread::new(same.iter().map(|row| figure(row)));
            Row {
                subject: "all".to_owned(),
                folds: same.len(),
                mse: spread(|row| row.mse.mean),
                mse_uv2: spread(|row| row.mse_uv2.mean),
                prd_percent: spread(|row| row.prd_percent.mean),
                ..kind.clone()
            }
        })
        .collect()
}

impl Spread {
    /// Returns mean and sample standard deviation of `values`; for one value, the deviation is 0.
    fn new(values: impl Iterator<Item = f64> + Clone) -> Self {
        let count = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / count;
        let squares: f64 = values.map(|value| (value - mean).powi(2)).sum();
        Self { mean, sd: (squares / (count - 1.0).max(1.0)).sqrt() }
    }
}
