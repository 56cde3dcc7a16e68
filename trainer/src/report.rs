//! Report of a training run, an evaluation or a cross-validation: pictures, their values as CSV,
//! and a page that shows them.

mod cross_validation;
mod evaluation;
mod learning;
mod packed;

use crate::comparison::Comparison;
use crate::crossval::Table;
use crate::error::TrainerError;
use crate::learning_curve::Learning;
use crate::output::check_writable;
use new_file::NewFileError;
use picture::canvas::PictureError;
use picture::page::Page;
use std::fs;
use std::path::Path;

/// File name of the page.
const PAGE: &str = "index.html";
/// Label of an axis with mean squared errors in units of `input.sd_uv` squared.
const MSE: &str = "mean squared error (1 = variance of the training part)";

/// A report; its page is written last.
struct Report<'a> {
    folder: &'a Path,
    page: Page,
}

impl<'a> Report<'a> {
    fn new(folder: &'a Path, title: &str) -> Self {
        Self {
            folder,
            page: Page::new(title),
        }
    }

    /// Draws a picture with its values, both of which have `name` before the ending, and adds them
    /// to the page.
    fn add_picture(
        &mut self,
        name: &str,
        draw: impl FnOnce(&Path) -> Result<(), PictureError>,
        caption: &str,
        values: &str,
    ) -> Result<(), TrainerError> {
        let [picture, csv] = ["svg", "csv"].map(|ending| format!("{name}.{ending}"));
        draw(&self.folder.join(&picture))?;
        self.write(&csv, values)?;
        self.page.push_picture(&picture, caption, &[&csv]);
        Ok(())
    }

    /// Writes the page.
    fn finish(self) -> Result<(), TrainerError> {
        self.write(PAGE, &self.page.to_html())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), TrainerError> {
        let path = self.folder.join(name);
        fs::write(&path, text).map_err(TrainerError::file(&path))
    }
}

/// Creates the folder of a report, if one is named, and tries to write to it.
///
/// # Errors
/// If the folder holds a report already and `force` is false, or it cannot be written.
pub fn prepare(folder: Option<&Path>, force: bool) -> Result<(), TrainerError> {
    let Some(folder) = folder else {
        return Ok(());
    };
    let path = folder.join(PAGE);
    if !force && path.exists() {
        return Err(NewFileError::Exists { path }.into());
    }
    check_writable(folder)
}

/// Returns a message with the path of a report.
pub fn message(folder: &Path) -> String {
    format!("report written to {}", folder.join(PAGE).display())
}

/// Writes the report of a training run into a folder: learning curves if it had epochs, and the
/// pictures of [`write_evaluation`] if it had test recordings.
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

/// Writes the report of an evaluation into a folder: error of each electrode, and of PCA with fewer
/// numbers.
///
/// # Errors
/// If a file cannot be written.
pub fn write_evaluation(folder: &Path, comparison: &Comparison) -> Result<(), TrainerError> {
    let mut report = Report::new(folder, "Error of a model");
    evaluation::add(&mut report, comparison)?;
    report.finish()
}

/// Writes the report of a cross-validation into a folder: errors of all folds, and their learning
/// curves.
///
/// # Errors
/// If a file cannot be written.
pub fn write_crossval(folder: &Path, table: &Table) -> Result<(), TrainerError> {
    let mut report = Report::new(folder, "Cross-validation");
    cross_validation::add(&mut report, table)?;
    report.finish()
}
