//! The benchmark `model`: cost of the model in a folder, such as one that `trainer` has written.

use std::path::Path;

use serde_json::Value as Json;

use super::cost::{self, Parts};
use super::figures::Report;

/// Encodes at least `windows` windows with the model in `folder` on each emulated machine, and builds the boards'
/// images with it.
///
/// # Errors
/// The folder has no model, the model does not fit a board, or QEMU or the target is missing.
pub(crate) fn measure(folder: &Path, windows: usize) -> anyhow::Result<Report> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let figures = cost::measure(&name, folder, windows, Parts::EncoderAndBoards)?;
    let next =
        "`cargo test --package pipeline --test streaming_equals_batch` with CORTICODE_ARTIFACT";
    Report::new("model", Json::Object(figures), next)
}
