//! `cargo xtask bench host`: codes per second on one core of this PC, beside PyTorch's.

mod agreement;
mod contender;
mod inputs;
mod report;

use std::path::Path;
use std::process::Command;

use self::agreement::Agreement;
use self::contender::Process;
use self::inputs::Inputs;
use self::report::{Report, Speeds};
use super::emulator::target_folder;
use crate::command::{cargo_with, root, run};
use crate::failure::Failure;

/// Rounds of turns: in each, every contender has one. One more before them warms up.
const ROUNDS: usize = 9;

/// Pythons that are asked for PyTorch.
const PYTHONS: [&str; 2] = ["python3", "/usr/bin/python3"];

/// Builds our contender, starts both, gives them their turns.
///
/// # Errors
/// A contender does not build or run, or its codes are not those of the reference.
pub(crate) fn measure() -> Result<Report, Failure> {
    run(
        &mut cargo_with(&["build", "--release", "--package=bench", "--example=host"]),
        "read the compiler's message above",
    )?;
    let target = target_folder()?;
    let folder = target.join("bench").join("host");
    let inputs = Inputs::make()?;
    inputs.write(&folder)?;

    let own = target.join("release").join("examples").join("host");
    let mut ours = Process::start(Command::new(own), &folder)?;
    let mut theirs = torch(&folder)?;
    let agreement = Agreement::of(&inputs, &folder, theirs.is_some())?;

    let progress = super::progress_bar(ROUNDS + 1);
    let mut rounds = Vec::new();
    for _ in 0..=ROUNDS {
        rounds.push(Speeds {
            streaming: ours.turn(bench::host::STREAMING)?,
            windows: ours.turn(bench::host::WINDOWS)?,
            pipeline: ours.turn(bench::host::PIPELINE)?,
            torch: match &mut theirs {
                Some(theirs) => Some([theirs.turn("single")?, theirs.turn("batch")?]),
                None => None,
            },
        });
        progress.inc(1);
    }
    progress.finish_and_clear();
    let torch = theirs.map(|theirs| theirs.greeting.clone());
    Ok(Report::new(
        ours.greeting.clone(),
        torch,
        &rounds[1..],
        agreement,
    ))
}

/// PyTorch on one thread, if a Python has it.
fn torch(folder: &Path) -> Result<Option<Process>, Failure> {
    let has_torch = |python: &&&str| {
        let mut import = Command::new(python);
        crate::command::succeeds(import.args(["-c", "import torch"]))
    };
    let Some(python) = PYTHONS.iter().find(has_torch) else {
        eprintln!(
            "SKIPPED: PyTorch: neither {} imports torch; `python3 -m venv torch-venv && \
             torch-venv/bin/pip install torch`, then again with torch-venv/bin first in PATH",
            PYTHONS.join(" nor ")
        );
        return Ok(None);
    };
    let mut command = Command::new(python);
    command
        .arg(root().join("bench").join("torch_encoder.py"))
        .arg(Inputs::weights())
        .arg(Inputs::cells())
        .env("OMP_NUM_THREADS", "1")
        .env("MKL_NUM_THREADS", "1");
    Process::start(command, folder).map(Some)
}
