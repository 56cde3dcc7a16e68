//! The same work in Python with scipy and PyTorch.

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use artifact::Description;
use serde::Deserialize;

use crate::report::{python_model, tools};

/// What one run of `offline_torch.py` prints.
#[derive(Debug, Deserialize)]
pub(crate) struct Answer {
    /// Version of PyTorch.
    pub(crate) torch: String,
    /// Version of scipy.
    pub(crate) scipy: String,
    /// Duration of encoding, seconds.
    pub(crate) encode_s: f64,
    /// Duration of decoding, seconds.
    pub(crate) decode_s: f64,
}

/// A Python interpreter that imports PyTorch and scipy.
#[derive(Debug)]
pub(crate) struct Torch(&'static str);

impl Torch {
    /// Finds an interpreter that imports both; `None` if there is none.
    pub(crate) fn find() -> Option<Self> {
        let next = "`python3 -m venv torch-venv && torch-venv/bin/pip install torch numpy scipy`, then again \
                    with torch-venv/bin first in PATH";
        tools::python("torch, scipy", next).map(Self)
    }

    /// Encodes and decodes the samples in `folder`.
    ///
    /// # Errors
    /// The process fails.
    pub(crate) fn run(&self, folder: &Path, description: &Description) -> anyhow::Result<Answer> {
        let request = python_model::request(description);
        let mut process = Command::new(self.0)
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/offline_torch.py"))
            .arg(folder)
            .env("OMP_NUM_THREADS", "1")
            .env("MKL_NUM_THREADS", "1")
            .env("OPENBLAS_NUM_THREADS", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        // The pipe is dropped at the end of the statement, which ends the process's input.
        let mut input = process.stdin.take().context("it has no standard input")?;
        input.write_all(request.to_string().as_bytes())?;
        drop(input);
        let output = process.wait_with_output()?;
        ensure!(
            output.status.success(),
            "scipy and PyTorch (`tests/bench/offline_torch.py`) failed: {}\n  next: read its messages above",
            output.status
        );
        Ok(serde_json::from_slice(&output.stdout)?)
    }
}
