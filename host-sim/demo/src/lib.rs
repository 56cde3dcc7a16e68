//! `cargo demo`: the whole signal path on this machine for some seconds, and pictures of the run.
//! `cargo loop`: a [closed loop](closed_loop), from electrodes to a decision.
//!
//! ```text
//! host-sim ── PTY ── corticode-bridge ── TCPROS ── chain (master, subscriber) ── Run
//!                                                                                 │
//! Reference (the same EEG through the filters alone) ────────── Comparison ───────┴─ pictures
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod chain;
pub mod closed_loop;
mod comparison;
mod pictures;
mod program;
mod progress;
pub mod response;
mod run;

use std::fmt::Display;
use std::path::Path;

use picture::spread::Spread;
use program::{BOARD, BRIDGE};

use crate::comparison::Comparison;

/// Runs the whole signal path, draws the pictures and prints the summary.
///
/// # Errors
/// A program does not start or does not respond in time, a code is lost, or a file cannot be
/// written.
pub fn demo(seconds: u32, seed: u64, programs: &Path) -> Result<(), Failure> {
    if !model::HAS_NETWORK {
        let why = "the built-in model has the packed code alone, and the demo shows codes";
        return Err(Failure::missing("a network", why, "unset CORTICODE_ARTIFACT"));
    }
    require(programs, &[BOARD, BRIDGE], "cargo demo")?;
    let pictures = programs.with_file_name("demo");
    let run = in_a_folder(async |folder| chain::run(seconds, seed, programs, folder).await)?;
    let comparison = Comparison::new(&run, seconds, seed)?;
    pictures::draw_all(&run, &comparison, &pictures)?;

    let arrival = Spread::from_values(&run.arrival_intervals_ms());
    let device = Spread::from_values(&run.device_intervals_ms());
    let [made, received, lost] = [run.made, run.received(), run.lost()];
    let printed = new_file::print(format_args!(
        "pictures: {}\n\
         codes made {made}, received {received}, lost {lost}; interval {arrival} ms at the \
         subscriber, {device} ms by the device's stamps\n\
         decoded synthetic EEG against the filtered: {comparison}\n",
        pictures.display()
    ));
    let next = "make room on the disk and run it again";
    printed.map_err(|error| Failure::check("printing", error, next))?;
    if lost == 0 && received > 0 {
        return Ok(());
    }
    let why = format!("{lost} of {made} codes did not arrive");
    let next = "is the machine busy? `cargo demo` again; then `cargo xtask test`";
    Err(Failure::check("the demo", why, next))
}

/// Runs `what` with a temporary folder, until `what` ends or the user presses Ctrl-C.
fn in_a_folder<T>(what: impl AsyncFnOnce(&Path) -> Result<T, Failure>) -> Result<T, Failure> {
    let folder = tempfile::tempdir().map_err(|error| {
        let next = "is the disk full? is TMPDIR writable?";
        Failure::check("making a temporary folder", error, next)
    })?;
    let runtime =
        tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
    let next = "look for a limit on processes: `ulimit -u`";
    let runtime = runtime.map_err(|error| Failure::check("starting threads", error, next))?;
    runtime.block_on(async {
        tokio::select! {
            result = what(folder.path()) => result,
            _ = tokio::signal::ctrl_c() => Err(Failure::interrupted()),
        }
    })
}

/// Checks that the folder `programs` holds the programs `names`; the command `builder` builds them.
fn require(programs: &Path, names: &[&str], builder: &str) -> Result<(), Failure> {
    let missing = names.iter().find(|name| !programs.join(name).exists());
    missing.map_or(Ok(()), |name| {
        let why = format!("no {}", programs.join(name).display());
        let next = format!("`{builder}`, which builds all programs before it starts this one");
        Err(Failure::missing("a built program", why, &next))
    })
}

/// A failure that ends the program.
#[derive(Debug)]
pub struct Failure {
    /// Exit status: 1 if a check failed, 2 if a file is missing, 3 if one of the programs did not
    /// start or respond, 130 after Ctrl-C.
    pub status: u8,
    /// Text that states what failed, why, and what the user can do next.
    pub message: String,
}

impl Failure {
    /// Returns the failure of a check: what failed, why, and what to do next.
    pub fn check(what: &str, why: impl Display, next: &str) -> Self {
        Self::new(1, what, "failed", why, next)
    }

    pub(crate) fn missing(what: &str, why: impl Display, next: &str) -> Self {
        Self::new(2, what, "is missing", why, next)
    }

    pub(crate) fn unreachable(what: &str, why: impl Display, next: &str) -> Self {
        Self::new(3, what, "is not reachable", why, next)
    }

    fn new(status: u8, what: &str, problem: &str, why: impl Display, next: &str) -> Self {
        let message = format!("{what} {problem}: {why}\n  next: {next}");
        Self { status, message }
    }

    pub(crate) fn interrupted() -> Self {
        let message = "interrupted; everything that was started is stopped".to_owned();
        Self { status: 130, message }
    }
}
