//! The subcommand `convert`: reads a recording twice and writes one file for each stream in it.

use std::fs::File;
use std::io::Read;
use std::path::PathBuf;
use std::sync::Arc;

use bridge_core::Model;
use capture::{Conversion, ConvertSummary, FileFormat};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use crate::app::classifying::read_classifier;
use crate::app::command_line::choice;
use crate::error::BridgeError;

/// Write a recording as files of codes and samples, one for each stream in it.
///
/// FILE.codes.gdf has the codes and FILE.reconstructed.gdf the EEG decoded from them. FILE.raw.gdf
/// and FILE.filtered.gdf exist if these streams were recorded, and FILE.predictions.gdf exists if
/// features were recorded and --classifier names their classifier. The number of a row gives its
/// time, because rows that were lost, or are missing between two runs of the device, are written as
/// fillers with a flag. Each event is in the first row whose time is not before the event. A file
/// appears under its name when it is complete; an existing file is replaced only with --force.
///
/// Exit status: 0 done, 1 a file cannot be written, 2 wrong usage, no usable recording or an
/// existing file.
#[derive(Args, Clone, Debug)]
pub(crate) struct ConvertOptions {
    /// Recording to read
    file: PathBuf,
    /// Format of the files to write
    #[arg(long, value_parser = choice::<FileFormat>())]
    to: FileFormat,
    /// Folder of the model to decode with, instead of the built-in one
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    model: Option<PathBuf>,
    /// Classifier file that `trainer classify` wrote and with which the recording was made: apply
    /// the classifier to the recorded features, and write its predictions
    #[arg(long, env = "CORTICODE_CLASSIFIER", value_name = "FILE")]
    classifier: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    force: bool,
}

/// Converts a recording, with a progress bar for each pass over the file if stderr is a terminal.
///
/// # Errors
///
/// [`BridgeError`] if the recording or the model cannot be read, or a file cannot be written.
pub(super) fn convert(options: &ConvertOptions) -> Result<ConvertSummary, BridgeError> {
    let model = Model::read(options.model.as_deref());
    let model = Arc::new(model.map_err(BridgeError::Model)?);
    let conversion = Conversion {
        file: options.file.clone(),
        to: options.to,
        force: options.force,
        classifier: options.classifier.as_deref().map(read_classifier).transpose()?,
    };
    Ok(capture::convert(&conversion, model, with_progress)?)
}

/// Returns a reader of `file` that shows its progress in a bar until it is dropped.
fn with_progress(file: File, what: &'static str) -> impl Read {
    let bytes = file.metadata().map_or(0, |metadata| metadata.len());
    let bar = ProgressBar::new(bytes).with_message(what);
    let style = ProgressStyle::with_template("{msg} {wide_bar} {percent}%");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.wrap_read(file)
}
