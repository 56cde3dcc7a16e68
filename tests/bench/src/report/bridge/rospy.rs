//! The node in rospy, where rospy is installed.

use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use anyhow::Context;
use neuro_ros::{NeuroFrame, RosMessage};

use crate::report::tools;

/// A Python interpreter that imports rospy.
#[derive(Debug, Clone, Copy)]
pub(in crate::report) struct Rospy(&'static str);

/// Returns the arguments of a script that describe the codes: their length, and their rate in Hz.
pub(in crate::report) fn code_arguments() -> [String; 2] {
    let rate_hz = usize::from(model::STEP_RATE_HZ) / model::HOP;
    [model::CODE, rate_hz].map(|number| number.to_string())
}

impl Rospy {
    /// Finds an interpreter that imports rospy; `None` if there is none.
    pub(in crate::report) fn find() -> Option<Self> {
        tools::python("rospy", "`apt-get install python3-rospy`, then again").map(Self)
    }

    /// Finds an interpreter that imports rospy, scipy and PyTorch; `None` if there is none.
    pub(in crate::report) fn find_with_torch() -> Option<Self> {
        let next = "`/usr/bin/python3 -m venv --system-site-packages torch-venv && torch-venv/bin/pip install torch \
                    scipy`, then again with torch-venv/bin first in PATH";
        tools::python("rospy, scipy, torch", next).map(Self)
    }

    /// Starts `rospy_bridge.py`, which connects to `port` of 127.0.0.1 and publishes on `topic`.
    ///
    /// # Errors
    /// The interpreter does not start.
    pub(in crate::report) fn start(
        self,
        master_uri: &str,
        port: u16,
        topic: &str,
        folder: &Path,
    ) -> anyhow::Result<Child> {
        let [length, rate] = code_arguments();
        let arguments = [&*port.to_string(), topic, &length, &rate];
        self.start_script("rospy_bridge.py", &arguments, master_uri, folder)
    }

    /// Starts a script of this crate, whose input is the definition of `NeuroFrame`.
    ///
    /// # Errors
    /// The interpreter does not start.
    pub(in crate::report) fn start_script(
        self,
        script: &str,
        arguments: &[&str],
        master_uri: &str,
        folder: &Path,
    ) -> anyhow::Result<Child> {
        let mut process = Command::new(self.0)
            .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(script))
            .args(arguments)
            .env("ROS_MASTER_URI", master_uri)
            .env("ROS_HOSTNAME", "127.0.0.1")
            .env("ROS_HOME", folder)
            .env_remove("ROS_IP")
            // One thread, as the node in Rust.
            .envs(
                ["OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"].map(|of| (of, "1")),
            )
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .with_context(|| format!("{script} does not start"))?;
        // The pipe is dropped at the end of the statement, which ends the process's input.
        let mut definition = process.stdin.take().context("it has no standard input")?;
        definition.write_all(NeuroFrame::TYPE.definition.as_bytes())?;
        Ok(process)
    }
}
