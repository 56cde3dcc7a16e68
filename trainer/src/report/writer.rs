//! Files of a report while it is written.

use crate::error::TrainerError;
use picture::canvas::PictureError;
use picture::page::Page;
use std::fs;
use std::path::Path;

/// File name of the page.
pub(super) const PAGE: &str = "index.html";
/// Label of an axis with mean squared errors in units of `input.sd_uv` squared.
pub(super) const MSE: &str = "mean squared error (1 = variance of the training part)";

/// A report while it is written; its page is the last file.
pub(super) struct Report<'a> {
    folder: &'a Path,
    pub(super) page: Page,
}

impl<'a> Report<'a> {
    /// Starts a report in a folder that exists.
    pub(super) fn new(folder: &'a Path, title: &str) -> Self {
        Self {
            folder,
            page: Page::new(title),
        }
    }

    /// Draws a picture with its values, both of which have `name` before the ending, and adds them to the page.
    pub(super) fn add_picture(
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
    pub(super) fn finish(self) -> Result<(), TrainerError> {
        self.write(PAGE, &self.page.to_html())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), TrainerError> {
        let path = self.folder.join(name);
        fs::write(&path, text).map_err(|source| TrainerError::File { path, source })
    }
}
