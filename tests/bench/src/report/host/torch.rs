//! PyTorch on one thread: a process that times the same network in f32.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use model::{CELLS, CODE, GRID_CELL, STEPS};
use serde::Deserialize;

use super::agreement::COMPARED;
use crate::report::checked_in::ARTIFACT;
use crate::report::tools;

/// What one run of `torch_encoder.py` prints.
#[derive(Debug, Deserialize)]
pub(crate) struct Answer {
    /// Version of PyTorch.
    pub(crate) version: String,
    /// Codes of the first [`COMPARED`] windows, value by value.
    pub(crate) codes: Vec<f32>,
    /// Codes per second with one window per call.
    pub(crate) single: f64,
    /// Codes per second with all windows in one call.
    pub(crate) batch: f64,
}

/// A Python interpreter that imports PyTorch.
#[derive(Debug)]
pub(crate) struct Torch(&'static str);

impl Torch {
    /// Finds an interpreter that imports PyTorch; `None` if there is none.
    pub(crate) fn find() -> Option<Self> {
        let next = "`python3 -m venv torch-venv && torch-venv/bin/pip install torch`, then again with \
                    torch-venv/bin first in PATH";
        tools::python("torch", next).map(Self)
    }

    /// Encodes the windows, whose values are ordered by time step and cell. Times one call per window, and
    /// one call with all windows.
    ///
    /// # Errors
    /// The process fails, or its codes are incomplete or not numbers.
    pub(crate) fn encode(&self, windows: &[[f32; STEPS * CELLS]]) -> anyhow::Result<Answer> {
        let bytes = windows.as_flattened().iter();
        let bytes: Vec<u8> = bytes.flat_map(|cell| cell.to_le_bytes()).collect();
        let cells: Vec<String> = GRID_CELL.iter().map(ToString::to_string).collect();
        let mut command = Command::new(self.0);
        command
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/torch_encoder.py"))
            .arg(Path::new(ARTIFACT).join("weights.safetensors"))
            .args([cells.join(","), COMPARED.to_string()])
            .env("OMP_NUM_THREADS", "1")
            .env("MKL_NUM_THREADS", "1");
        answer(&mut command, &bytes).context(
            "PyTorch (`tests/bench/torch_encoder.py`) failed\n  next: read its messages above",
        )
    }
}

/// Runs a command with `input` on its stdin, and parses what it prints.
fn answer(command: &mut Command, input: &[u8]) -> anyhow::Result<Answer> {
    let mut process = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    // The pipe is dropped at the end of the statement, which ends the process's input.
    process
        .stdin
        .take()
        .context("it has no standard input")?
        .write_all(input)?;
    let output = process.wait_with_output()?;
    ensure!(output.status.success(), "{}", output.status);
    let answer: Answer = serde_json::from_slice(&output.stdout)?;
    let (found, expected) = (answer.codes.len(), COMPARED * CODE);
    ensure!(
        found == expected,
        "its codes have {found} numbers, {expected} are expected"
    );
    Ok(answer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_has_a_number_for_each_value_of_the_codes() {
        let run = |script: &str, codes: &[&str]| {
            let codes = codes.join(", ");
            let json = format!("{{'version': '2', 'codes': [{codes}], 'single': 7, 'batch': 9}}");
            answer(
                Command::new("sh").args(["-c", script]),
                json.replace('\'', "\"").as_bytes(),
            )
        };
        let codes = vec!["0.5"; COMPARED * CODE];
        let sound = run("cat", &codes).expect("an answer");
        assert_eq!((sound.codes[1], sound.single, sound.batch), (0.5, 7.0, 9.0));
        assert!(run("cat", &codes[1..]).is_err());
        assert!(run("cat", &[&codes[1..], &["NaN"]].concat()).is_err());
        assert!(run("cat; exit 3", &codes).is_err());
    }
}
