//! Processes the files of a folder in parallel.

use std::{
    collections::{HashMap, HashSet},
    ffi::OsStr,
    fs, io,
    num::NonZero,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};
use offline::{OfflineError, Progress};
use signal_hook::consts::{SIGINT, SIGTERM};
use thiserror::Error;

use crate::command_line::BatchOptions;

/// Time between two updates of the progress bar.
const TICK: Duration = Duration::from_millis(100);

/// Why a batch failed.
#[derive(Debug, Error)]
pub(crate) enum BatchError {
    /// A folder with files to process cannot be read.
    #[error("{} cannot be read; name a file or a folder that exists", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    /// The folder to process has no file with one of the wanted extensions.
    #[error(
        "{} has no file with the extension {endings}; name another folder, or a file",
        path.display()
    )]
    Nothing { path: PathBuf, endings: String },
    /// A folder for the output cannot be created.
    #[error("the folder {} cannot be created", path.display())]
    Folder { path: PathBuf, source: io::Error },
    /// Two inputs would be written to the same output file.
    #[error(
        "{} and {} would both become {}; rename one of them, or process them one by one",
        inputs[0].display(),
        inputs[1].display(),
        output.display()
    )]
    SameOutput { inputs: [PathBuf; 2], output: PathBuf },
    /// Some files failed; their errors were printed.
    #[error("{failed} of {files} files failed, see above; the others are complete")]
    Some {
        failed: usize,
        files: usize,
        /// Smallest exit status among the errors of the failed files.
        status: u8,
    },
    /// SIGINT and SIGTERM cannot be caught.
    #[error("Ctrl-C cannot be received")]
    Signals(#[from] io::Error),
}

impl BatchError {
    /// Returns the exit status with which the program ends after this error.
    pub(crate) fn exit_status(&self) -> u8 {
        match self {
            Self::Some { status, .. } => *status,
            _ => 2,
        }
    }
}

/// A file to read and the file that is written from it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Job {
    pub(crate) input: PathBuf,
    pub(crate) output: PathBuf,
    /// Path of the input relative to the processed folder; its file name if no folder is processed.
    pub(crate) name: PathBuf,
}

/// Returns the jobs for `input`. A file is one job, which writes `output`. A folder has one job for
/// each file with one of the `extensions` in it or its subfolders. Each of these jobs writes to the
/// folder `output`, at the relative path that `rename` returns for the input's relative path.
///
/// # Errors
/// [`BatchError`] if there is nothing to do, or a folder cannot be read or created.
pub(crate) fn jobs(
    input: &Path,
    output: &Path,
    extensions: &[&str],
    rename: impl Fn(&Path) -> PathBuf,
) -> Result<Vec<Job>, BatchError> {
    if !input.is_dir() {
        return Ok(vec![Job {
            input: input.to_owned(),
            output: output.to_owned(),
            name: input.file_name().unwrap_or(OsStr::new("recording")).into(),
        }]);
    }
    let mut files = Vec::new();
    collect(input, extensions, &mut files, &mut HashSet::new())?;
    files.sort();
    if files.is_empty() {
        return Err(BatchError::Nothing {
            path: input.to_owned(),
            endings: extensions.join(" or "),
        });
    }
    let jobs = files.into_iter().map(|file| {
        let below = file.strip_prefix(input).unwrap_or(&file);
        Job { output: output.join(rename(below)), name: below.to_owned(), input: file }
    });
    let jobs: Vec<Job> = jobs.collect();
    let mut outputs = HashMap::new();
    for job in &jobs {
        if let Some(other) = outputs.insert(&job.output, &job.input) {
            return Err(BatchError::SameOutput {
                inputs: [other.clone(), job.input.clone()],
                output: job.output.clone(),
            });
        }
    }
    for folder in jobs.iter().filter_map(|job| job.output.parent()) {
        fs::create_dir_all(folder)
            .map_err(|source| BatchError::Folder { path: folder.to_owned(), source })?;
    }
    Ok(jobs)
}

/// Appends to `files` those files of a folder and its subfolders that have one of the extensions.
/// `visited` has the folders read already, so that links in a circle cause no endless loop.
fn collect(
    folder: &Path,
    extensions: &[&str],
    files: &mut Vec<PathBuf>,
    visited: &mut HashSet<PathBuf>,
) -> Result<(), BatchError> {
    let unreadable = |source| BatchError::Unreadable { path: folder.to_owned(), source };
    if !visited.insert(folder.canonicalize().map_err(unreadable)?) {
        return Ok(());
    }
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.is_dir() {
            collect(&path, extensions, files, visited)?;
        } else if path.is_file() && has_extension(&path, extensions) {
            files.push(path);
        }
    }
    Ok(())
}

/// Returns whether a file has one of the extensions, in upper or lower case, and is not hidden.
pub(crate) fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let is_hidden = path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default();
    let mut extensions = extensions.iter();
    !is_hidden && extensions.any(|other| extension.eq_ignore_ascii_case(other))
}

/// Results of a batch, and the time that it took.
pub(crate) struct Finished<'j, R> {
    /// Each job that succeeded, with its result, in the order of the jobs.
    pub(crate) results: Vec<(&'j Job, R)>,
    /// Error that counts the failed jobs; `None` if all succeeded.
    pub(crate) failure: Option<BatchError>,
    pub(crate) elapsed: Duration,
    pub(crate) threads: usize,
}

/// Runs `work` for all jobs in parallel. Prints the error of each job that fails, and continues
/// with the others. `seconds` is the total duration of EEG in all jobs, if it is known.
///
/// # Errors
/// The error of the job if there is only one; [`OfflineError::Interrupted`] after SIGINT or
/// SIGTERM.
pub(crate) fn run<'j, R: Send>(
    jobs: &'j [Job],
    options: &BatchOptions,
    seconds: Option<u64>,
    work: impl Fn(&Job, &Progress, &ProgressBar) -> Result<R, OfflineError> + Sync,
) -> Result<Finished<'j, R>, Box<dyn std::error::Error>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // A second SIGINT or SIGTERM ends the program at once.
        signal_hook::flag::register_conditional_shutdown(signal, 1, stop.clone())
            .map_err(BatchError::Signals)?;
        signal_hook::flag::register(signal, stop.clone()).map_err(BatchError::Signals)?;
    }
    let threads = options
        .jobs
        .map_or_else(|| thread::available_parallelism().map_or(1, NonZero::get), NonZero::get);
    let threads = threads.min(jobs.len());
    let progress = Progress::default();
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    let left = if seconds.is_some() { ", {eta} left" } else { "" };
    let bar = progress_bar(seconds, &format!("s of signal{left}"), options.quiet);
    let start = Instant::now();
    thread::scope(|scope| {
        let workers = (0..threads).map(|_| {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(job) = jobs.get(index) else { return };
                    let result = work(job, &progress, &bar);
                    let interrupted = matches!(result, Err(OfflineError::Interrupted));
                    if let Err(error) = &result
                        && !interrupted
                        && jobs.len() > 1
                    {
                        bar.suspend(|| new_file::message!("host-sim: {}", crate::chain(error)));
                    }
                    let mut results = results.lock().unwrap_or_else(PoisonError::into_inner);
                    results.push((index, result));
                    if interrupted {
                        return;
                    }
                }
            })
        });
        let workers: Vec<_> = workers.collect();
        while !workers.iter().all(thread::ScopedJoinHandle::is_finished) {
            bar.set_position(progress.seconds());
            if stop.load(Ordering::Relaxed) {
                progress.interrupt();
            }
            thread::sleep(TICK.min(start.elapsed() / 8));
        }
        bar.finish_and_clear();
    });
    let elapsed = start.elapsed();
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    // Interrupted jobs sort last, so that the loop has counted all complete files before it reports
    // the interruption.
    results
        .sort_by_key(|(index, result)| (matches!(result, Err(OfflineError::Interrupted)), *index));
    let mut finished = Vec::new();
    let (mut failed, mut status) = (0, 2);
    for (index, result) in results {
        match result {
            Ok(result) => finished.push((&jobs[index], result)),
            Err(error) if jobs.len() == 1 => return Err(error.into()),
            Err(error @ OfflineError::Interrupted) => {
                new_file::message!("{} of {} files are complete", finished.len(), jobs.len());
                return Err(error.into());
            }
            Err(error) => {
                failed += 1;
                status = error.exit_status().min(status);
            }
        }
    }
    let failure = (failed > 0).then_some(BatchError::Some { failed, files: jobs.len(), status });
    Ok(Finished { results: finished, failure, elapsed, threads })
}

/// Returns a progress bar over `seconds` of signal, or a spinner if the duration is not known.
/// `end` is indicatif's template of the text after the number of seconds.
pub(crate) fn progress_bar(seconds: Option<u64>, end: &str, quiet: bool) -> ProgressBar {
    let (bar, place) = match seconds {
        _ if quiet => return ProgressBar::hidden(),
        Some(seconds) => (ProgressBar::new(seconds), "{bar:32} {pos}/{len}"),
        None => (ProgressBar::new_spinner(), "{spinner} {pos}"),
    };
    match ProgressStyle::with_template(&format!("{{elapsed_precise}} {place} {end}")) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

impl<R> Finished<'_, R> {
    /// Returns a line that states how many times faster than real time `seconds` of signal were
    /// processed.
    pub(crate) fn speed(&self, seconds: f64) -> String {
        let times = seconds / self.elapsed.as_secs_f64();
        let per_thread = match self.threads {
            0 | 1 => String::new(),
            threads => format!(" in {threads} threads"),
        };
        format!(
            "{seconds:.1} s of signal in {:.2} s{per_thread}: {times:.0} times real time",
            self.elapsed.as_secs_f64()
        )
    }
}
