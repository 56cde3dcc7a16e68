//! The command line of `trainer`: its commands and options, and how it prints results.

mod terminal;

use crate::check::{CheckOptions, check};
use crate::classify::{self, ClassifierLossOptions, ClassifyOptions};
use crate::comparison;
use crate::crossval::{self, CrossvalOptions};
use crate::difference::Difference;
use crate::error::TrainerError;
use crate::import::Import;
use crate::montage_check::{MontageCheck, RecordingCheck};
use crate::packed::{self, PackedOptions, RateTable};
use crate::progress::ProgressObserver;
use crate::report;
use crate::selection::TestFiles;
use crate::session::{self, TrainOptions};
use crate::show::Shown;
use crate::substitution::{self, SubstitutionOptions};
use artifact::MontageFile;
use clap::{Args, Parser, Subcommand};
use rustix::time::{ClockId, clock_gettime};
use serde_json::Value as Json;
use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;
use terminal::Terminal;

/// Trains models of EEG, evaluates them, imports networks, and shows, compares and checks models.
#[derive(Debug, Parser)]
#[command(version)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Train a model and write its artifact.
    Train(Box<TrainOptions>),
    /// Print the figures of an artifact on recordings, and for comparison the figures of PCA with
    /// the same number of components.
    Evaluate(EvaluateArgs),
    /// Compare a model with PCA by cross-validation, for each subject.
    Crossval(Box<CrossvalArgs>),
    /// Train a packed model: as few bits as the requested error allows.
    Packed(Box<PackedOptions>),
    /// Train the table with which a device finds and substitutes bad electrodes.
    Substitution(SubstitutionOptions),
    /// Train a classifier: spatial filters whose band powers a device sends, and the decision that
    /// a host makes from them.
    Classify(Box<ClassifyOptions>),
    /// Make a model from the tensors of a network that was trained elsewhere, for example in
    /// PyTorch.
    Import(Import),
    /// Print a model's contents: grid, training card, filters, layers, memory.
    Show(ShowArgs),
    /// Print the differences between two models. Exit status: 0 equal, 1 different, 2 error.
    Diff(DiffArgs),
    /// Check files, integers and golden codes of a model. Exit status: 0 sound, 1 golden codes
    /// differ, 2 error.
    Check(CheckOptions),
    /// Work with montage files, such as those in `files/montages/`.
    #[command(subcommand)]
    Montage(MontageVerb),
}

#[derive(Args, Debug)]
struct EvaluateArgs {
    /// Folder to read the artifact from.
    #[arg(long)]
    artifact: PathBuf,
    #[command(flatten)]
    files: TestFiles,
    #[command(flatten)]
    loss: ClassifierLossOptions,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Args, Debug)]
struct CrossvalArgs {
    #[command(flatten)]
    options: CrossvalOptions,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Args, Debug)]
struct ReportArgs {
    /// Folder to write a report to: pictures with their values, and a page that shows them. The
    /// report of a cross-validation is written after all folds are done.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace a report in the folder of --report.
    #[arg(long, requires = "report")]
    force: bool,
}

#[derive(Args, Debug)]
struct ShowArgs {
    /// Folder of the model.
    #[arg(default_value = "signal/model/artifact")]
    folder: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Args, Debug)]
struct DiffArgs {
    /// Folder of the first model.
    one: PathBuf,
    /// Folder of the second model.
    other: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum MontageVerb {
    /// Print the grid of a montage and every mistake in it. Exit status: 0 no mistake, 2 mistakes.
    Check {
        /// Montage file.
        file: PathBuf,
        /// Recording (EDF, BDF, GDF) to compare with the montage: which electrodes it has, which
        /// are missing.
        #[arg(long)]
        recording: Option<PathBuf>,
    },
}

/// Exit status for wrong usage, and for every error of a command that inspects or imports files.
const USAGE: u8 = 2;

/// Runs the program. Returns 0 for success, 1 for a failure, 2 for wrong usage and 130 after
/// Ctrl-C. Commands that inspect or import files return 2 for every error. If they find a
/// difference or a mistake, `diff` and `check` return 1, and `montage check` returns 2.
pub fn run() -> ExitCode {
    let (result, on_failure) = match Cli::parse().verb {
        Verb::Train(options) => (train(&options), 1),
        Verb::Evaluate(args) => (evaluate(&args), 1),
        Verb::Crossval(args) => (cross_validate(&args), 1),
        Verb::Packed(options) => (train_packed(&options), 1),
        Verb::Substitution(options) => (train_substitution(&options), 1),
        Verb::Classify(options) => (classify(&options), 1),
        Verb::Import(import) => (run_import(&import), USAGE),
        Verb::Show(args) => (show(&args), USAGE),
        Verb::Diff(args) => (diff(&args), USAGE),
        Verb::Check(options) => (check_model(&options), USAGE),
        Verb::Montage(MontageVerb::Check { file, recording }) => {
            (check_montage(&file, recording.as_deref()), USAGE)
        }
    };
    let error = match result {
        Ok(status) => return status,
        Err(error) => error,
    };
    print_error(&error);
    ExitCode::from(match error {
        TrainerError::Interrupted(..) => 130,
        error if error.is_usage() => USAGE,
        _ => on_failure,
    })
}

/// Trains a model, and prints its figures on the test recordings.
fn train(options: &TrainOptions) -> Result<ExitCode, TrainerError> {
    if let Some(comparison) = session::train(options, &mut Terminal::with_interrupt()?)? {
        new_file::print(comparison)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the figures of a model and of its PCA on recordings.
fn evaluate(args: &EvaluateArgs) -> Result<ExitCode, TrainerError> {
    let folder = args.report.report.as_deref();
    report::prepare(folder, args.report.force)?;
    let terminal = &mut Terminal::new();
    let comparison =
        comparison::compare_for(&args.artifact, &args.files, Some(&args.loss), terminal)?;
    if let Some(folder) = folder {
        report::write(folder, "Error of a model", None, Some(&comparison))?;
        terminal.message(&report::message(folder));
    }
    print(&comparison, args.json.then(|| comparison.to_json()))?;
    Ok(ExitCode::SUCCESS)
}

/// Runs a cross-validation, and prints the table if all folds have an outcome.
fn cross_validate(args: &CrossvalArgs) -> Result<ExitCode, TrainerError> {
    let CrossvalArgs { options, report } = args;
    report::prepare(report.report.as_deref(), report.force)?;
    let start = Instant::now();
    let terminal = &mut Terminal::new();
    let table = crossval::run(options, terminal)?;
    terminal.message(&cost(start));
    let out = options.out.display();
    let Some(table) = table else {
        terminal.message(&format!(
            "folds of other shards are missing; once all are in {out}/folds, the same command prints \
             the table"
        ));
        return Ok(ExitCode::SUCCESS);
    };
    new_file::print(&table)?;
    terminal.message(&format!("table.md, table.csv and table.json written to {out}"));
    if let Some(folder) = &report.report {
        report::write_crossval(folder, &table)?;
        terminal.message(&report::message(folder));
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the wall time since `start`, and this process's processor time and peak memory, as text.
fn cost(start: Instant) -> String {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    let wall = start.elapsed().as_secs_f64();
    let memory = peak_memory_mb().map_or_else(String::new, |mb| format!(", peak memory {mb} MB"));
    format!("{wall:.0} s, {} s of processor time{memory}", time.tv_sec)
}

/// Returns the peak memory of this process, megabytes; `None` if the system does not report it.
fn peak_memory_mb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let mut lines = status.lines();
    let line = lines.find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024 / 1_000_000)
}

/// Trains a packed model. Prints its bits and errors at each rate, and for comparison the bits and
/// errors of the same transform code without prediction.
fn train_packed(options: &PackedOptions) -> Result<ExitCode, TrainerError> {
    let trained = packed::train(options, &mut Terminal::new())?;
    new_file::print(format_args!(
        "packed code\n{}\nKLT of a block, coded alike, without prediction\n{}",
        RateTable(&trained.figures),
        RateTable(&trained.without_prediction)
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// Trains a table of substitutions. Prints its errors, and the convergence of its sweeps.
fn train_substitution(options: &SubstitutionOptions) -> Result<ExitCode, TrainerError> {
    new_file::print(substitution::train(options, &mut Terminal::new())?)?;
    Ok(ExitCode::SUCCESS)
}

/// Trains a classifier, and prints its figures on trials that were not used for training.
fn classify(options: &ClassifyOptions) -> Result<ExitCode, TrainerError> {
    report::prepare(options.report.as_deref(), options.force)?;
    let terminal = &mut Terminal::new();
    let trained = classify::train(options, terminal)?;
    if let Some(folder) = &options.report {
        report::write_classifier(folder, &trained)?;
        terminal.message(&report::message(folder));
    }
    print(&trained, options.json.then(|| trained.to_json()))?;
    Ok(ExitCode::SUCCESS)
}

fn run_import(import: &Import) -> Result<ExitCode, TrainerError> {
    let imported = import.run()?;
    let (id, folder) = (&imported.id, import.out.display());
    new_file::print(format_args!("{imported}model {id} written to {folder}\n"))?;
    Ok(ExitCode::SUCCESS)
}

fn show(args: &ShowArgs) -> Result<ExitCode, TrainerError> {
    let shown = Shown::read(&args.folder)?;
    print(&shown, args.json.then(|| shown.to_json()))?;
    Ok(ExitCode::SUCCESS)
}

/// Prints the differences between two models. Returns exit status 1 if there are any.
fn diff(args: &DiffArgs) -> Result<ExitCode, TrainerError> {
    let difference = Difference::read([&args.one, &args.other])?;
    print(&difference, args.json.then(|| difference.to_json()))?;
    Ok(ExitCode::from(u8::from(!difference.is_empty())))
}

/// Checks a model and prints the result. Returns exit status 1 unless the golden codes are right.
fn check_model(options: &CheckOptions) -> Result<ExitCode, TrainerError> {
    let checked = check(options)?;
    print(&checked, options.json.then(|| checked.to_json()))?;
    Ok(ExitCode::from(u8::from(!checked.is_good())))
}

/// Prints the mistakes in a montage, and how a recording fits it. Returns exit status 2 if the
/// montage has mistakes.
fn check_montage(file: &Path, recording: Option<&Path>) -> Result<ExitCode, TrainerError> {
    let montage = MontageFile::read(file)?;
    let check = MontageCheck::new(&montage);
    new_file::print(&check)?;
    if !check.mistakes.is_empty() {
        return Ok(ExitCode::from(USAGE));
    }
    if let Some(recording) = recording {
        new_file::print(RecordingCheck::read(recording, &montage)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints `json` if it is given, otherwise `object` as text.
fn print(object: &impl fmt::Display, json: Option<Json>) -> Result<(), TrainerError> {
    let printed = match json {
        Some(json) => new_file::print(format_args!("{json:#}\n")),
        None => new_file::print(object),
    };
    Ok(printed?)
}

/// Prints an error with its causes to standard error.
fn print_error(error: &dyn Error) {
    new_file::message!("trainer: {error}");
    let mut cause = error.source();
    while let Some(error) = cause {
        new_file::message!("  because {error}");
        cause = error.source();
    }
}
