//! The same updates in PyTorch.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use artifact::Description;
use serde_json::json;

use super::round::{BATCH, RATE, Round, WARM_UP};
use crate::report::{python_model, tools};

/// A Python interpreter that imports PyTorch.
#[derive(Debug)]
pub(crate) struct Torch(&'static str);

impl Torch {
    /// Finds an interpreter that imports PyTorch; `None` if there is none.
    pub(crate) fn find() -> Option<Self> {
        let next = "`python3 -m venv torch-venv && torch-venv/bin/pip install torch numpy`, then again with \
                    torch-venv/bin first in PATH";
        tools::python("torch", next).map(Self)
    }

    /// Trains on the windows in `folder`.
    ///
    /// # Errors
    /// The process fails.
    pub(crate) fn train(&self, folder: &Path, description: &Description) -> anyhow::Result<Round> {
        let request = json!({
            "model": python_model::request(description),
            "batch": BATCH,
            "warm_up": WARM_UP,
            "rate": RATE,
        });
        let output = Command::new(self.0)
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/training_torch.py"))
            .arg(folder)
            .arg(request.to_string())
            .env("OMP_NUM_THREADS", "1")
            .env("MKL_NUM_THREADS", "1")
            .stderr(Stdio::inherit())
            .output()?;
        ensure!(
            output.status.success(),
            "PyTorch (`tests/bench/training_torch.py`) failed: {}\n  next: read its messages above",
            output.status
        );
        serde_json::from_slice(&output.stdout).context("PyTorch printed something else")
    }
}
