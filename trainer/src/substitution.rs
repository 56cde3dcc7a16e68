//! Trains the table with which a device substitutes bad electrodes.
//!
//! ```text
//! tracks --> second moment --> inverse --> weights (Q7) --> typical innovations
//!                                             |
//!                                             v
//!                                  sweeps: must converge
//! ```

mod fit;
mod sweeps;

use crate::card;
use crate::error::TrainerError;
use crate::people::People;
use crate::progress::ProgressObserver;
use crate::selection::{TrainingFiles, check_writable};
use artifact::{
    Artifact, SubstitutionDescription, SubstitutionFigures, SubstitutionTable, SubstitutionTraining,
};
use std::path::PathBuf;

pub(crate) use sweeps::{filled, largest_radius};

/// Options of `trainer substitution`.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct SubstitutionOptions {
    /// Folder of the artifact to which the table is added; its montage and filters are used.
    #[arg(long)]
    artifact: PathBuf,
    #[command(flatten)]
    files: TrainingFiles,
    /// Replace the table of --artifact.
    #[arg(long)]
    force: bool,
}

/// Trains a table of substitutions, adds it to an artifact, and returns a text that states its
/// errors and its convergence.
///
/// # Errors
/// If the recordings cannot be used or do not determine a table, its sweeps do not converge, or
/// files cannot be written.
pub(crate) fn train(
    options: &SubstitutionOptions,
    observer: &mut impl ProgressObserver,
) -> Result<String, TrainerError> {
    let folder = &options.artifact;
    let artifact = Artifact::read(folder).map_err(TrainerError::no_model(folder))?;
    if artifact.substitution.is_some() && !options.force {
        let part = "table of substitutions";
        return Err(TrainerError::PartExists(folder.clone(), part));
    }
    let selected = options.files.find()?;
    check_writable(folder)?;
    let description = &artifact.description;
    let people = People::read(&selected.train, &options.files, description, observer)?;
    let test = People::read(&selected.test, &options.files, description, observer)?.tracks;
    let train = people.at_equal_power(observer);
    let electrodes = &description.montage.electrodes;
    let interpolated = card::interpolated(electrodes, &train);
    if !interpolated.is_empty() {
        observer.message(&format!(
            "warning: training recordings lack {}: the table predicts their interpolations, which \
             are exact mixes of other electrodes; train on recordings that have them",
            interpolated.join(", ")
        ));
    }
    let weights = fit::weights(&train, electrodes.len())?;
    let mut table = SubstitutionTable {
        description: SubstitutionDescription {
            format: 1,
            training: SubstitutionTraining::default(),
        },
        innovation: fit::innovation(&weights, &train),
        weights,
    };
    let radius = largest_radius(&table, description)?;
    if test.is_empty() {
        observer.message("no test recordings: the errors are those of the training recordings");
    }
    let tested = if test.is_empty() { &train } else { &test };
    let figures = fit::figures(&table, tested, electrodes);
    let [train_files, test_files] = selected.names();
    table.description.training = SubstitutionTraining {
        train_files,
        test_files,
        interpolated,
        people: people.card(),
        figures: figures.clone().filter(|_| !test.is_empty()),
    };
    let id = artifact.with_substitution(Some(table))?.write(folder)?;
    observer.message(&format!("model {id} written to {}", folder.display()));
    let none = || "no electrode is in every recording, so none has an error".to_owned();
    let errors = figures.as_ref().map_or_else(none, figures_text);
    Ok(format!("{errors}\n{}\n", radius_text(radius)))
}

/// Returns a text that states that substitution converges.
pub(crate) fn radius_text(radius: f64) -> String {
    format!(
        "the substitution of bad electrodes converges, with a spectral radius of at most {radius:.3}"
    )
}

/// Returns the errors of a table of substitutions as text.
pub(crate) fn figures_text(figures: &SubstitutionFigures) -> String {
    let SubstitutionFigures { median_nmse, worst_nmse, worst_electrode } = figures;
    format!(
        "NMSE of an electrode predicted from the others: median {median_nmse:.4}, \
         worst {worst_nmse:.4} ({worst_electrode})"
    )
}
