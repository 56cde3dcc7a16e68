//! The log of a program that is a ROS node.

use std::fs::File;
use std::sync::Arc;

use neuro_ros::Log;
use neuro_ros::ros1::NodeOptions;
use tokio::sync::mpsc::Receiver;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::writer::{BoxMakeWriter, MakeWriterExt};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use crate::app::rosout::RosoutLayer;
use crate::error::BridgeError;

/// Sends the log to stderr, and also to the log file if roslaunch names one. Returns the lines for
/// `/rosout`. `level` is the least severe level that is shown, such as `info`, unless `RUST_LOG`
/// selects another.
///
/// # Errors
///
/// [`BridgeError::Log`] if the log file cannot be written.
pub fn start(ros: &NodeOptions, level: &str) -> Result<Receiver<Log>, BridgeError> {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let writer = match &ros.log {
        None => BoxMakeWriter::new(std::io::stderr),
        Some(path) => {
            let file = File::options().create(true).append(true).open(path);
            let file = file.map_err(|source| BridgeError::Log {
                path: path.clone(),
                source,
            })?;
            BoxMakeWriter::new(std::io::stderr.and(Arc::new(file)))
        }
    };
    let (rosout, lines) = RosoutLayer::new();
    let written = tracing_subscriber::fmt::layer()
        .with_ansi(false)
        .with_writer(writer);
    tracing_subscriber::registry()
        .with(filter)
        .with(written)
        .with(rosout)
        .init();
    Ok(lines)
}
