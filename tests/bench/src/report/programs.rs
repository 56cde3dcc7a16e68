//! Finds and runs external programs that benchmarks use where installed: Python with the scripts of
//! this crate, and LLVM's tools.

use std::ffi::OsStr;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use artifact::Description;
use serde::de::DeserializeOwned;
use serde_json::{Value as Json, json};

use super::checked_in::ARTIFACT;

/// Python interpreters in the order in which they are tried.
const INTERPRETERS: [&str; 2] = ["python3", "/usr/bin/python3"];

/// A Python interpreter that can import the modules that a script needs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Python(&'static str);

impl Python {
    /// Finds an interpreter that can import `modules`. If there is none, prints that the
    /// measurement is skipped, then `next`, the advice what to do.
    pub(crate) fn find(modules: &str, next: &str) -> Option<Self> {
        let imports = format!("import {modules}");
        let imports =
            |python: &&str| output_of(Command::new(python).args(["-c", &imports])).is_some();
        let python = INTERPRETERS.into_iter().find(imports);
        if python.is_none() {
            let interpreters = INTERPRETERS.join(" nor ");
            eprintln!("SKIPPED: {modules}: neither {interpreters} imports it; {next}");
        }
        python.map(Self)
    }

    /// Finds an interpreter that can import PyTorch, numpy and scipy.
    pub(crate) fn find_torch() -> Option<Self> {
        let next = "`python3 -m venv torch-venv && torch-venv/bin/pip install torch numpy scipy`, then again \
                    with torch-venv/bin first in PATH";
        Self::find("torch, numpy, scipy", next)
    }

    /// Returns a command that runs a script of this crate on one thread, for a fair comparison.
    pub(crate) fn script(self, name: &str) -> Command {
        let mut command = Command::new(self.0);
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).envs(
            ["OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"].map(|of| (of, "1")),
        );
        command
    }

    /// Runs a script of this crate with `input` on its stdin, and parses the JSON that it prints.
    ///
    /// # Errors
    /// The script fails, or does not print the expected JSON.
    pub(crate) fn answer<T: DeserializeOwned>(
        self,
        script: &str,
        arguments: &[impl AsRef<OsStr>],
        input: &[u8],
    ) -> anyhow::Result<T> {
        let failed = || format!("tests/bench/{script} failed\n  next: read its messages above");
        answer(self.script(script).args(arguments), input).with_context(failed)
    }
}

/// Runs a command with `input` on its stdin, and parses its output as JSON.
fn answer<T: DeserializeOwned>(command: &mut Command, input: &[u8]) -> anyhow::Result<T> {
    let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    // This statement drops the pipe when it ends, which closes the command's input.
    let written = process.stdin.take().map(|mut stdin| stdin.write_all(input));
    let output = process.wait_with_output()?;
    ensure!(output.status.success(), "{}", output.status);
    written.context("it has no standard input")??;
    serde_json::from_slice(&output.stdout).context("it printed something else than its JSON object")
}

/// Returns the output of a command, or `None` if it does not start or its exit status is not 0.
pub(crate) fn output_of(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).output().ok()?;
    let printed = String::from_utf8_lossy(&output.stdout);
    output.status.success().then(|| printed.into_owned())
}

/// Returns a command that runs one of LLVM's tools. Debian adds the version to a tool's name; if no
/// tool has the plain name, the newest version is used.
///
/// # Errors
/// The tool is not installed.
pub(crate) fn llvm(name: &str) -> anyhow::Result<Command> {
    let versions = (14..=24).rev().map(|version| format!("{name}-{version}"));
    let mut names = std::iter::once(name.to_owned()).chain(versions);
    let installed = names.find(|name| output_of(Command::new(name).arg("--version")).is_some());
    let missing = || format!("no {name}; Debian's package is `llvm`");
    Ok(Command::new(installed.with_context(missing)?))
}

/// Returns the model's part of a script's input: its filters and its encoder.
pub(crate) fn model(description: &Description) -> Json {
    let filters = &description.filters;
    json!({
        "artifact": ARTIFACT,
        "cells": model::GRID_CELL.as_slice(),
        "numbers": model::CODE,
        "steps": model::STEPS,
        "hop": model::HOP,
        "rows": model::ROWS,
        "columns": model::COLUMNS,
        "decimation": model::ADC_RATE_HZ / model::STEP_RATE_HZ,
        "sd_uv": description.input.sd_uv,
        "rate_hz": model::ADC_RATE_HZ,
        "mains_hz": 50,
        "notch_q": filters.notch_q,
        "band_hz": filters.band_hz,
        "order": filters.order,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_the_json_of_a_script_that_succeeds() {
        let run = |script: &str, input: &str| {
            answer::<Vec<f32>>(Command::new("sh").args(["-c", script]), input.as_bytes())
        };
        assert_eq!(run("cat", "[0.5, 7]").expect("an answer"), [0.5, 7.0]);
        assert!(run("cat", "[0.5, NaN]").is_err());
        assert!(run("cat; exit 3", "[]").is_err());
        assert!(run("exit 3", "[]").is_err());
    }
}
