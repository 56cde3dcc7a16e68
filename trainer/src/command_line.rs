//! The command line: `trainer train`, `evaluate`, `crossval`, `merge` and `montage check`.

mod crossval;
mod evaluate;
mod mains;
mod montage;
mod packed;
mod shape;
mod terminal;
mod train;

use clap::{Parser, Subcommand};
use std::process::ExitCode;
use trainer::error::TrainerError;

use self::crossval::{CrossvalArgs, MergeArgs};
use self::evaluate::EvaluateArgs;
use self::montage::MontageVerb;
use self::packed::PackedArgs;
use self::terminal::print_error;
use self::train::TrainArgs;

/// Trains the convolutional autoencoder on EEG recordings, and writes the artifact.
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Train a model and write its artifact.
    Train(Box<TrainArgs>),
    /// Print the figures of an artifact on recordings, beside PCA with the same number of components.
    Evaluate(EvaluateArgs),
    /// Compare a model with PCA by cross-validation, for each subject.
    Crossval(Box<CrossvalArgs>),
    /// Make the table of a cross-validation from the folders of its shards.
    Merge(MergeArgs),
    /// Train a packed model: as few bits as the wanted error allows.
    Packed(PackedArgs),
    /// Work with montage files, such as those in `files/montages/`.
    #[command(subcommand)]
    Montage(MontageVerb),
}

/// Runs the program; returns 0, 1 for a failure, 2 for wrong usage and 130 after Ctrl-C.
pub(crate) fn run() -> ExitCode {
    let result = match Cli::parse().verb {
        Verb::Train(args) => args.run(),
        Verb::Evaluate(args) => args.run(),
        Verb::Crossval(args) => args.run(),
        Verb::Merge(args) => args.run(),
        Verb::Packed(args) => args.run(),
        Verb::Montage(verb) => return verb.run(),
    };
    let Err(error) = result else {
        return ExitCode::SUCCESS;
    };
    print_error(&error);
    match error {
        // Settings and montages that no model can have are wrong usage.
        TrainerError::MontageFile(_)
        | TrainerError::MontageMistakes { .. }
        | TrainerError::TooManyNumbers { .. }
        | TrainerError::TooFewBlocks { .. }
        | TrainerError::NothingFound { .. }
        | TrainerError::NothingMatches { .. }
        | TrainerError::EmptyFolder { .. }
        | TrainerError::BadPattern { .. }
        | TrainerError::BadRange { .. }
        | TrainerError::TrainedOn { .. }
        | TrainerError::NothingToTest
        | TrainerError::ArtifactExists { .. }
        | TrainerError::Report(_)
        | TrainerError::NothingToReport
        | TrainerError::OtherTraining { .. }
        | TrainerError::OtherEpochs { .. }
        | TrainerError::OtherCrossval { .. }
        | TrainerError::PaperMode
        | TrainerError::PackedExists { .. }
        | TrainerError::Coefficients { .. }
        | TrainerError::TargetOutOfReach { .. }
        | TrainerError::Shape(_) => ExitCode::from(2),
        TrainerError::Interrupted { .. } => ExitCode::from(130),
        _ => ExitCode::FAILURE,
    }
}
