//! What ends the bridge other than its work being done.

use std::path::PathBuf;

use artifact::ArtifactError;
use neuro_ros::SinkError;
use neuro_ros::ros1::NodeError;
use thiserror::Error;

use crate::query::report::DeviceSummary;

/// What ends the bridge other than its work being done. A device or a master that is away does
/// not: the bridge waits for them.
#[derive(Debug, Error)]
pub enum BridgeError {
    /// The port can never be one.
    #[error(
        "{port} cannot be a port: {source}; name a serial port, such as /dev/ttyACM0, or tcp:HOST:PORT"
    )]
    Port {
        /// As it was given.
        port: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The port does not run at the chosen speed.
    #[error("{port} cannot be used: {source}")]
    Speed {
        /// As it was given.
        port: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// No model to decode with.
    #[error(
        "the model cannot be read; --model takes a folder with model.toml, weights.safetensors and calibration.safetensors"
    )]
    Model(#[source] ArtifactError),
    /// What shall be announced is not asked for.
    #[error(
        "--announce names a stream that --streams leaves out; add it to --streams, such as \
         --streams codes,raw --announce raw"
    )]
    AnnouncedNotStreamed,
    /// The port does not open or has gone, and nobody waits for it.
    #[error("{port} {what}; {remedy}")]
    Unreachable {
        /// As it was given.
        port: String,
        /// Which of both.
        what: &'static str,
        /// What to do.
        remedy: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Nothing answers at the port.
    #[error(
        "no answer {what} within {seconds} s; check cable, power and --baud, and that no other \
         program uses the port"
    )]
    NoAnswer {
        /// To what.
        what: &'static str,
        /// How long it was waited for.
        seconds: u32,
    },
    /// The device answers, and does not do it.
    #[error("the device refuses {what}: {why}")]
    Refused {
        /// What it was asked for.
        what: &'static str,
        /// Why, and what to do next.
        why: &'static str,
    },
    /// The device began anew in the middle of what it was asked for.
    #[error(
        "the device started anew in the middle of its self-test and found out nothing: {device}; try \
         again, and report what it says if it does so again"
    )]
    RestartedDuringTest {
        /// Who it is, why it started, and what its last run left behind.
        device: Box<DeviceSummary>,
    },
    /// ROS does not let us in.
    #[error("the ROS node cannot be had; check the name, ROS_IP and ROS_MASTER_URI")]
    Node(#[from] NodeError),
    /// The output cannot be written.
    #[error("the frames have nowhere to go")]
    Sink(#[from] SinkError),
    /// The log file that roslaunch asked for cannot be written.
    #[error("the log file {path} cannot be written; check __log:= or the disk")]
    Log {
        /// Where it should be.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The system gives no signals or no threads.
    #[error("the system refuses what the bridge needs to run")]
    System(#[from] std::io::Error),
}

impl BridgeError {
    /// Exit status: 1 a check failed, 2 usage, 3 device or ROS not reachable, 4 the device is there
    /// and refuses.
    pub fn exit_code(&self) -> u8 {
        match self {
            BridgeError::Sink(_)
            | BridgeError::System(_)
            | BridgeError::RestartedDuringTest { .. } => 1,
            BridgeError::Port { .. }
            | BridgeError::Speed { .. }
            | BridgeError::Model(_)
            | BridgeError::Log { .. }
            | BridgeError::AnnouncedNotStreamed
            | BridgeError::Node(NodeError::Name(_) | NodeError::MasterUri(_)) => 2,
            BridgeError::Node(_)
            | BridgeError::Unreachable { .. }
            | BridgeError::NoAnswer { .. } => 3,
            BridgeError::Refused { .. } => 4,
        }
    }
}
