//! PyTorch on one thread: a process that times the same network in f32.

use std::fmt::Display;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use emulator::EmulatorError;
use model::{CELLS, GRID_CELL, STEPS};

use crate::report::checked_in::ARTIFACT;
use crate::report::failure::Failure;
use crate::report::tools;

/// Python interpreters, tried in this order.
const PYTHONS: [&str; 2] = ["python3", "/usr/bin/python3"];

/// Input of the float network, ordered by time step and cell.
type Window = [f32; STEPS * CELLS];

/// A running `torch_encoder.py`; dropping it ends the process.
#[derive(Debug)]
pub(crate) struct Torch {
    process: Child,
    commands: ChildStdin,
    answers: BufReader<ChildStdout>,
    /// Version of PyTorch: the first line that the process prints.
    pub(crate) version: String,
}

impl Torch {
    /// Starts PyTorch in `folder` and waits until it has encoded the windows; `None` where no Python has it.
    ///
    /// # Errors
    /// The process does not start or ends early, or the folder is not writable.
    pub(crate) fn start(folder: &Path, windows: &[Window]) -> Result<Option<Self>, Failure> {
        let imports_torch =
            |python: &&&str| tools::succeeds(Command::new(python).args(["-c", "import torch"]));
        let Some(python) = PYTHONS.iter().find(imports_torch) else {
            eprintln!(
                "SKIPPED: PyTorch: neither {} imports torch; `python3 -m venv torch-venv && \
                 torch-venv/bin/pip install torch`, then again with torch-venv/bin first in PATH",
                PYTHONS.join(" nor ")
            );
            return Ok(None);
        };
        let bytes = windows.as_flattened().iter();
        let bytes: Vec<u8> = bytes.flat_map(|cell| cell.to_le_bytes()).collect();
        fs::create_dir_all(folder).map_err(EmulatorError::file(folder))?;
        let path = folder.join("windows.bin");
        fs::write(&path, bytes).map_err(EmulatorError::file(&path))?;
        let cells: Vec<String> = GRID_CELL.iter().map(ToString::to_string).collect();
        let mut command = Command::new(python);
        command
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/torch_encoder.py"))
            .arg(Path::new(ARTIFACT).join("weights.safetensors"))
            .arg(cells.join(","))
            .env("OMP_NUM_THREADS", "1")
            .env("MKL_NUM_THREADS", "1")
            .current_dir(folder);
        Self::spawn(&mut command).map(Some)
    }

    fn spawn(command: &mut Command) -> Result<Self, Failure> {
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = piped.spawn().map_err(failed)?;
        let (Some(commands), Some(answers)) = (process.stdin.take(), process.stdout.take()) else {
            return Err(failed("it has no standard streams"));
        };
        let mut torch = Self {
            process,
            commands,
            answers: BufReader::new(answers),
            version: String::new(),
        };
        torch.version = torch.line()?;
        Ok(torch)
    }

    /// Reads the codes of all windows, value by value, from the file that the process has written.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn codes(folder: &Path) -> Result<Vec<f32>, Failure> {
        let path = folder.join("torch.bin");
        let bytes = fs::read(&path).map_err(EmulatorError::file(&path))?;
        let values = bytes.as_chunks().0.iter();
        Ok(values.map(|&value| f32::from_le_bytes(value)).collect())
    }

    /// Times `single`, one window per call, or `batch`, all windows in one call; returns codes per second.
    ///
    /// # Errors
    /// The process has ended, or its answer is malformed.
    pub(crate) fn time(&mut self, mode: &str) -> Result<f64, Failure> {
        writeln!(self.commands, "{mode}").map_err(failed)?;
        let answer = self.line()?;
        codes_per_second(&answer).ok_or_else(|| failed(format!("its answer was {answer:?}")))
    }

    fn line(&mut self) -> Result<String, Failure> {
        let mut line = String::new();
        match self.answers.read_line(&mut line) {
            Ok(0) => Err(failed("it has ended")),
            Ok(_) => Ok(line.trim_end().to_owned()),
            Err(error) => Err(failed(error)),
        }
    }
}

impl Drop for Torch {
    fn drop(&mut self) {
        // Both calls fail when the process has already ended.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn failed(why: impl Display) -> Failure {
    let next = "read its messages above";
    Failure::new("PyTorch (`bench/torch_encoder.py`)", why, next)
}

/// Parses an answer `CODES NANOSECONDS`.
fn codes_per_second(answer: &str) -> Option<f64> {
    let (codes, nanoseconds) = answer.split_once(' ')?;
    let [codes, nanoseconds] = [codes.parse::<u32>(), nanoseconds.parse::<u32>()];
    let (codes, nanoseconds) = (codes.ok()?, nanoseconds.ok()?);
    (codes > 0 && nanoseconds > 0).then(|| f64::from(codes) / f64::from(nanoseconds) * 1e9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_codes_and_nanoseconds() {
        assert_eq!(codes_per_second("250 125000000"), Some(2_000.0));
        for wrong in ["", "250", "250 ", "250 0", "0 5", "-1 5", "panicked at"] {
            assert_eq!(codes_per_second(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_process_that_ends_early_is_a_failure() {
        let ended = Torch::spawn(&mut Command::new("true"));
        let failure = ended.expect_err("it prints nothing").to_string();
        assert!(failure.contains("failed: it has ended"), "{failure}");
    }
}
