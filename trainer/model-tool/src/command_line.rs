//! The command line: `model-gen show`, `diff`, `check` and `import`.

mod log;

use clap::{Args, Parser, Subcommand};
use model_tool::ToolError;
use model_tool::check::{Recordings, check};
use model_tool::difference::Difference;
use model_tool::import::Import;
use model_tool::show::Shown;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use self::log::Log;

/// Shows, compares, checks and imports models.
///
/// Ends with status 0 if all is well, 1 if models differ or a check fails, and 2 for an error.
#[derive(Debug, Parser)]
#[command(name = "model-gen", version)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Print what a model is: grid, training card, filters, layers, memory.
    Show(ShowArgs),
    /// Print the differences between two models.
    Diff(DiffArgs),
    /// Check files, integers and golden codes of a model, and its error on recordings.
    Check(CheckArgs),
    /// Make a model from the tensors of a network that was trained elsewhere, for example in PyTorch.
    Import(ImportArgs),
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

#[derive(Args, Debug)]
struct CheckArgs {
    /// Folder of the model.
    #[arg(default_value = "signal/model/artifact")]
    folder: PathBuf,
    /// Folder with recordings, to measure the error of the model and of PCA on them.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Recordings to test with: files, folders, patterns, ends of the names of files in --data, or ranges of them
    /// like R11..R12 [default: those in the training card].
    #[arg(long, value_delimiter = ',')]
    test: Vec<String>,
    /// Mains frequency of the recordings, Hz [default: that of the training].
    #[arg(long, value_parser = ["50", "60"])]
    mains: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Args, Debug)]
struct ImportArgs {
    /// The network's state_dict, and windows to calibrate and to compare with.
    #[arg(long, value_name = "FILE")]
    safetensors: PathBuf,
    /// What the tensors do not say: mode, montage, scale, names.
    #[arg(long, value_name = "FILE")]
    spec: PathBuf,
    /// Folder to write the model to.
    #[arg(long)]
    out: PathBuf,
    /// Replace a model in the folder.
    #[arg(long)]
    force: bool,
}

/// Runs the program.
pub(crate) fn run() -> ExitCode {
    let result = match Cli::parse().verb {
        Verb::Show(args) => show(&args),
        Verb::Diff(args) => diff(&args),
        Verb::Check(args) => check_model(args),
        Verb::Import(args) => import(args),
    };
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            print_error(&error);
            ExitCode::from(2)
        }
    }
}

fn show(args: &ShowArgs) -> Result<bool, ToolError> {
    let shown = Shown::read(&args.folder)?;
    if args.json {
        println!("{:#}", shown.to_json());
    } else {
        print!("{shown}");
    }
    Ok(true)
}

/// Returns whether the models are equal.
fn diff(args: &DiffArgs) -> Result<bool, ToolError> {
    let difference = Difference::read([&args.one, &args.other])?;
    if args.json {
        println!("{:#}", difference.to_json());
    } else {
        print!("{difference}");
    }
    Ok(difference.is_empty())
}

/// Returns whether the golden codes are right.
fn check_model(args: CheckArgs) -> Result<bool, ToolError> {
    let wants_recordings = args.data.is_some() || !args.test.is_empty();
    let recordings = wants_recordings.then(|| Recordings {
        data: args.data.unwrap_or_else(|| PathBuf::from(".")),
        names: args.test,
        mains_hz: args.mains.and_then(|mains| mains.parse().ok()),
    });
    let checked = check(&args.folder, recordings.as_ref(), &mut Log)?;
    if args.json {
        println!("{:#}", checked.to_json());
    } else {
        print!("{checked}");
    }
    Ok(checked.is_good())
}

fn import(args: ImportArgs) -> Result<bool, ToolError> {
    let ImportArgs {
        safetensors,
        spec,
        out,
        force,
    } = args;
    let import = Import {
        tensors: safetensors,
        spec,
        out,
        force,
    };
    let imported = import.run()?;
    print!("{imported}");
    println!("model {} written to {}", imported.id, import.out.display());
    Ok(true)
}

/// Prints an error with its causes to standard error.
fn print_error(error: &dyn Error) {
    eprintln!("model-gen: {error}");
    let mut cause = error.source();
    while let Some(error) = cause {
        eprintln!("  because {error}");
        cause = error.source();
    }
}
