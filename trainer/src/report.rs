//! Report of a training run, an evaluation or a cross-validation: pictures, the values in them as
//! CSV, and a page that shows the pictures.

mod classifier;
mod cross_validation;
mod evaluation;
mod learning;
mod packed;
mod people;

use crate::classify::Trained;
use crate::comparison::Comparison;
use crate::crossval::Table;
use crate::error::TrainerError;
use crate::selection::check_writable;
use crate::training::Learning;
use new_file::NewFileError;
use picture::canvas::PictureError;
use picture::page::Page;
use std::fs;
use std::path::Path;

/// File name of a report's page.
const PAGE: &str = "index.html";
/// Label of an axis with mean squared errors in units of `input.sd_uv` squared.
const MSE: &str = "mean squared error (1 = variance of the training part)";

/// A report in progress. Its page is written last, after all pictures.
struct Report<'a> {
    folder: &'a Path,
    page: Page,
}

impl<'a> Report<'a> {
    fn new(folder: &'a Path, title: &str) -> Self {
        Self { folder, page: Page::new(title) }
    }

    /// Draws the picture `name` and writes the values in it to a CSV file of the same name, and
    /// adds both to the page.
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

    fn finish(self) -> Result<(), TrainerError> {
        self.write(PAGE, &self.page.to_html())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), TrainerError> {
        let path = self.folder.join(name);
        fs::write(&path, text).map_err(TrainerError::file(&path))
    }
}

/// Creates the folder of a report, if `folder` is given, and checks that it is writable.
///
/// # Errors
/// If the folder already holds a report and `force` is false, or the folder is not writable.
pub(crate) fn prepare(folder: Option<&Path>, force: bool) -> Result<(), TrainerError> {
    let Some(folder) = folder else {
        return Ok(());
    };
    let path = folder.join(PAGE);
    if !force && path.exists() {
        return Err(NewFileError::Exists { path }.into());
    }
    check_writable(folder)
}

/// Returns a message that states where the report is.
pub(crate) fn message(folder: &Path) -> String {
    format!("report written to {}", folder.join(PAGE).display())
}

/// Writes the report of a training run or an evaluation to a folder: learning curves if there were
/// epochs, and the errors of each electrode if there were test recordings.
///
/// # Errors
/// If a file cannot be written.
pub(crate) fn write(
    folder: &Path,
    title: &str,
    learning: Option<&Learning>,
    comparison: Option<&Comparison>,
) -> Result<(), TrainerError> {
    let mut report = Report::new(folder, title);
    if let Some(learning) = learning {
        learning::add(&mut report, learning)?;
    }
    if let Some(comparison) = comparison {
        evaluation::add(&mut report, comparison)?;
    }
    report.finish()
}

/// Writes the report of a cross-validation to a folder: the errors of all folds.
///
/// # Errors
/// If a file cannot be written.
pub(crate) fn write_crossval(folder: &Path, table: &Table) -> Result<(), TrainerError> {
    let mut report = Report::new(folder, "Cross-validation");
    cross_validation::add(&mut report, table)?;
    report.finish()
}

/// Writes the report of a classifier to a folder.
///
/// # Errors
/// If a file cannot be written.
pub(crate) fn write_classifier(folder: &Path, trained: &Trained) -> Result<(), TrainerError> {
    let mut report = Report::new(folder, "Classifier");
    classifier::add(&mut report, trained)?;
    report.finish()
}
