//! `cargo demo`: the whole signal path on this machine for some seconds, and pictures of the run.
//!
//! ```text
//! host-sim ── PTY ── corticode-bridge ── TCPROS ── chain (master, subscriber) ── Run
//!                                                                                 │
//! Reference (the same EEG through the filters alone) ────────── Comparison ───────┴─ pictures
//! ```
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod chain;
mod comparison;
mod pictures;
mod program;
mod progress;
mod run;

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use picture::spread::Spread;

use crate::comparison::Comparison;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let numbers = match &words[..] {
        [seconds, seed] => seconds.parse().ok().zip(seed.parse().ok()),
        _ => None,
    };
    let Some((seconds, seed)) = numbers else {
        new_file::message!(
            "usage: demo SECONDS SEED; `cargo demo` builds all programs and starts this one"
        );
        return ExitCode::from(2);
    };
    match demo(seconds, seed) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            new_file::message!("\nerror: {}", failure.message);
            failure.status.into()
        }
    }
}

/// Runs the whole signal path, draws the pictures and prints the summary.
fn demo(seconds: u32, seed: u64) -> Result<(), Failure> {
    if !model::HAS_NETWORK {
        let why = "the built-in model has the packed code alone, and the demo shows codes";
        return Err(Failure::missing(
            "a network",
            why,
            "unset CORTICODE_ARTIFACT",
        ));
    }
    let programs = programs_folder()?;
    let pictures = programs.with_file_name("demo");
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build();
    let next = "look for a limit on processes: `ulimit -u`";
    let runtime = runtime.map_err(|error| Failure::check("starting threads", error, next))?;
    let run = runtime.block_on(chain::run(seconds, seed, &programs))?;
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

/// Returns the folder of this program. It must also hold host-sim and the bridge, which `cargo
/// demo` builds.
fn programs_folder() -> Result<PathBuf, Failure> {
    let own = std::env::current_exe().unwrap_or_default();
    let folder = own.parent().unwrap_or(Path::new("."));
    for program in [chain::BOARD, chain::BRIDGE] {
        let file = folder.join(program);
        if !file.exists() {
            let why = format!("no {}", file.display());
            let next = "`cargo demo`, which builds all programs before it starts this one";
            return Err(Failure::missing("a built program", why, next));
        }
    }
    Ok(folder.to_owned())
}

/// A failure that ends the demo.
#[derive(Debug)]
pub(crate) struct Failure {
    /// Exit status: 1 if a check failed, 2 if a file is missing, 3 if one of the programs did not
    /// start or did not answer, 130 after Ctrl-C.
    pub(crate) status: u8,
    /// What failed, why, and what the user can do next.
    pub(crate) message: String,
}

impl Failure {
    pub(crate) fn check(what: &str, why: impl Display, next: &str) -> Self {
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
        Self {
            status: 130,
            message,
        }
    }
}
