//! `trainer crossval` and `trainer merge`.

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use new_file::Existing;
use rustix::time::{ClockId, clock_gettime};
use std::path::{Path, PathBuf};
use std::time::Instant;
use trainer::card::Shape;
use trainer::crossval::{self, CrossvalObserver, CrossvalOptions, Outcome, Shard, Table};
use trainer::error::TrainerError;
use trainer::report;
use trainer::selection;
use trainer::training::Settings;

use super::mains::mains_hz;
use super::shape::ShapeArgs;
use super::train::BATCH;

/// Arguments of `trainer crossval`.
#[derive(Args, Debug)]
pub(crate) struct CrossvalArgs {
    /// Folder in which names of recordings are searched.
    #[arg(long, default_value = ".")]
    data: PathBuf,
    /// Recordings (EDF, BDF, GDF) of all subjects: files, folders, patterns such as 'S001*.edf', ends of the names of
    /// files in --data, or ranges of them like R03..R12 [default: all in --data].
    #[arg(long, value_delimiter = ',')]
    recordings: Vec<String>,
    /// Name of the only subject [default: what precedes the number of the run in the files' names].
    #[arg(long)]
    subject: Option<String>,
    #[command(flatten)]
    shape: ShapeArgs,
    /// Mains frequency of the recordings, Hz: 50 or 60.
    #[arg(long, value_parser = mains_hz)]
    mains: u32,
    /// Number of folds of each repetition.
    #[arg(long, default_value_t = 3)]
    folds: usize,
    /// Number of repetitions, each with another split into folds.
    #[arg(long, default_value_t = 3)]
    repetitions: usize,
    /// Contiguous blocks of each recording, which are dealt to the folds; 1 deals whole runs [default: 1 where a
    /// subject has a run for each fold].
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=100))]
    blocks: Option<u16>,
    /// Number of epochs of each fold.
    #[arg(long, default_value_t = 12)]
    epochs: u32,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Largest learning rate.
    #[arg(long, default_value_t = 1e-3)]
    learning_rate: f64,
    /// Compute only shard K of N of the folds. Shards may share the folder.
    #[arg(long, value_name = "K/N", default_value = "1/1")]
    shard: Shard,
    /// Folder of the outcomes and of the table. Folds whose outcome is there are not computed again.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
}

/// Arguments of `trainer merge`.
#[derive(Args, Debug)]
pub(crate) struct MergeArgs {
    /// Folders that `trainer crossval --out` wrote.
    #[arg(required = true)]
    folders: Vec<PathBuf>,
    /// Folder of the table and of all outcomes.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
}

/// Arguments of the report.
#[derive(Args, Debug)]
struct ReportArgs {
    /// Folder to write a report to once all folds are there: errors and learning curves of all folds, as pictures with
    /// their values and a page that shows them.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Replace a report in this folder.
    #[arg(long, requires = "report")]
    force: bool,
}

impl ReportArgs {
    /// Creates the folder and tries to write to it.
    fn prepare(&self) -> Result<(), TrainerError> {
        let existing = Existing::from_force(self.force);
        let folder = self.report.as_deref();
        folder.map_or(Ok(()), |folder| report::prepare(folder, existing))
    }

    fn write(&self, table: &Table) -> Result<(), TrainerError> {
        if let Some(folder) = &self.report {
            report::write_crossval(folder, table)?;
            eprintln!("{}", report::message(folder));
        }
        Ok(())
    }
}

impl CrossvalArgs {
    /// Runs the cross-validation, and prints the table once all folds are there.
    pub(crate) fn run(self) -> Result<(), TrainerError> {
        let recordings = if self.recordings.is_empty() {
            selection::all_in(&self.data)?
        } else {
            selection::recordings(&self.data, &self.recordings)?
        };
        let options = CrossvalOptions {
            recordings,
            subject: self.subject,
            montage: self.shape.montage()?,
            shape: Shape::from(&self.shape),
            mains_hz: self.mains,
            settings: Settings {
                epochs: self.epochs,
                batch: BATCH,
                peak_rate: self.learning_rate,
                seed: self.seed,
            },
            folds: self.folds,
            repetitions: self.repetitions,
            blocks: self.blocks.map(usize::from),
            shard: self.shard,
            out: self.out,
        };
        self.report.prepare()?;
        let start = Instant::now();
        let mut terminal = Terminal {
            bar: ProgressBar::hidden(),
        };
        let table = crossval::run(&options, &mut terminal)?;
        terminal.bar.finish_and_clear();
        eprintln!("{}", cost(start));
        print_table(table.as_ref(), &options.out);
        table.map_or(Ok(()), |table| self.report.write(&table))
    }
}

impl MergeArgs {
    /// Merges the outcomes and prints the table.
    pub(crate) fn run(&self) -> Result<(), TrainerError> {
        self.report.prepare()?;
        let table = crossval::merge(&self.folders, &self.out)?;
        print_table(Some(&table), &self.out);
        self.report.write(&table)
    }
}

fn print_table(table: Option<&Table>, folder: &Path) {
    match table {
        Some(table) => {
            print!("{table}");
            eprintln!(
                "table.md, table.csv and table.json written to {}",
                folder.display()
            );
        }
        None => eprintln!(
            "folds of other shards are missing; `trainer merge {} --out TABLE` makes the table once all are done",
            folder.display()
        ),
    }
}

/// Returns wall time, processor time and peak memory of this process, as text.
fn cost(start: Instant) -> String {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    let wall = start.elapsed().as_secs_f64();
    let memory = peak_memory_mb().map_or_else(String::new, |mb| format!(", peak memory {mb} MB"));
    format!("{wall:.0} s, {} s of processor time{memory}", time.tv_sec)
}

/// Returns the peak memory of this process, megabytes; `None` where the system does not say.
fn peak_memory_mb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024 / 1_000_000)
}

/// Prints progress to standard error: lines and a progress bar.
struct Terminal {
    bar: ProgressBar,
}

impl CrossvalObserver for Terminal {
    fn message(&mut self, text: &str) {
        self.bar.suspend(|| eprintln!("{text}"));
    }

    fn fold_started(&mut self, name: &str, number: usize, folds: usize) {
        if number == 1 || self.bar.is_hidden() {
            let template = "{prefix} {bar:30} {pos}/{len} folds, {eta} left, {msg}";
            let style = ProgressStyle::with_template(template).expect("a template with known keys");
            self.bar = ProgressBar::new(folds as u64).with_style(style);
        }
        self.bar.set_position(number as u64 - 1);
        self.bar.set_prefix(name.to_owned());
    }

    fn epoch_finished(&mut self, epoch: u32, epochs: u32, validation: f64) {
        let text = format!("epoch {epoch}/{epochs}, validation MSE {validation:.5}");
        self.bar.set_message(text);
    }

    fn fold_finished(&mut self, outcome: &Outcome) {
        self.bar.inc(1);
        let model = outcome.model_float.map_or(f64::NAN, |errors| errors.mse);
        let text = format!(
            "{}: MSE {model:.5}, PCA {:.5}; validation {:.5}, PCA {:.5}; best epoch {}; tested on {}",
            outcome.name(),
            outcome.pca_float.mse,
            outcome.validation.model,
            outcome.validation.pca,
            outcome.best_epoch,
            outcome.tested_on
        );
        self.message(&text);
    }
}
