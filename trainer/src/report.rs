//! Report of a training run, an evaluation or a cross-validation: pictures, their values as CSV, and a page that
//! shows them.

mod cross_validation;
mod evaluation;
mod learning;
mod packed;
mod writer;

use crate::comparison::Comparison;
use crate::crossval::Table;
use crate::error::TrainerError;
use crate::learning_curve::Learning;
use crate::output_folder::check_writable;
use new_file::{Existing, NewFileError};
use std::path::Path;
use writer::{PAGE, Report};

/// Creates the folder of a report, and tries to write to it.
///
/// # Errors
/// If the folder holds a report already and `existing` does not allow to replace it, or it cannot be written.
pub fn prepare(folder: &Path, existing: Existing) -> Result<(), TrainerError> {
    let path = folder.join(PAGE);
    if existing == Existing::Refuse && path.exists() {
        return Err(NewFileError::Exists { path }.into());
    }
    check_writable(folder)
}

/// Returns the line that tells a user where a report is.
pub fn message(folder: &Path) -> String {
    format!("report written to {}", folder.join(PAGE).display())
}

/// Writes the report of a training run into a folder: learning curves where it had epochs, and what
/// [`write_evaluation`] writes where it had test recordings.
///
/// # Errors
/// If a file cannot be written.
pub fn write_training(
    folder: &Path,
    learning: Option<&Learning>,
    comparison: Option<&Comparison>,
) -> Result<(), TrainerError> {
    let mut report = Report::new(folder, "Training of a model");
    if let Some(learning) = learning {
        learning::add(&mut report, learning)?;
    }
    if let Some(comparison) = comparison {
        evaluation::add(&mut report, comparison)?;
    }
    report.finish()
}

/// Writes the report of an evaluation into a folder: error of each electrode, and of PCA with fewer numbers.
///
/// # Errors
/// If a file cannot be written.
pub fn write_evaluation(folder: &Path, comparison: &Comparison) -> Result<(), TrainerError> {
    let mut report = Report::new(folder, "Error of a model");
    evaluation::add(&mut report, comparison)?;
    report.finish()
}

/// Writes the report of a cross-validation into a folder: errors of all folds, and their learning curves.
///
/// # Errors
/// If a file cannot be written.
pub fn write_crossval(folder: &Path, table: &Table) -> Result<(), TrainerError> {
    let mut report = Report::new(folder, "Cross-validation");
    cross_validation::add(&mut report, table)?;
    report.finish()
}
