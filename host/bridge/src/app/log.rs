//! The log of a program that is a ROS node, with its messages about a port that sends nothing.

use std::fs::File;
use std::sync::Arc;

use link::Counters;
use neuro_ros::Log;
use neuro_ros::ros1::NodeOptions;
use tokio::sync::mpsc::Receiver;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::writer::{BoxMakeWriter, MakeWriterExt};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use crate::app::rosout::RosoutLayer;
use crate::error::BridgeError;

/// Log levels of the ROS 2 libraries. They log events that do not concern a user, such as each
/// dropped message and each writer that ends after its node.
const QUIET: &str = "rustdds=error,rustdds::dds::pubsub=off,ros2_client=off";

/// Sends the log to stderr, and also to the log file if roslaunch names one. Returns the lines for
/// `/rosout`. `level` is the least severe level that is shown, such as `info`, unless `RUST_LOG`
/// selects another.
///
/// # Errors
///
/// [`BridgeError::Log`] if the log file cannot be written.
pub fn start(ros: &NodeOptions, level: &str) -> Result<Receiver<Log>, BridgeError> {
    let chosen = std::env::var("RUST_LOG").unwrap_or_default();
    let filter = levels(&chosen).or_else(|| levels(level)).unwrap_or_default();
    let writer = match &ros.log {
        None => BoxMakeWriter::new(std::io::stderr),
        Some(path) => {
            let file = File::options().create(true).append(true).open(path);
            let file = file.map_err(|source| BridgeError::Log(path.clone(), source))?;
            BoxMakeWriter::new(std::io::stderr.and(Arc::new(file)))
        }
    };
    let (rosout, lines) = RosoutLayer::new();
    let written = tracing_subscriber::fmt::layer()
        .with_ansi(false)
        // Without this, a closed stderr is reported with `eprintln!`, which panics.
        .log_internal_errors(false)
        .with_writer(writer);
    tracing_subscriber::registry().with(filter).with(written).with(rosout).init();
    if !chosen.is_empty() && levels(&chosen).is_none() {
        tracing::warn!(
            "RUST_LOG={chosen} is not used; write a level (error, warn, info, debug, trace, off), or \
             levels of libraries such as info,ros1=debug"
        );
    }
    Ok(lines)
}

/// Returns the least severe level to show of each library: the levels in [`QUIET`], overridden by
/// those in `chosen`, such as `info,ros1=debug`. `None` if `chosen` has no item, or one that is
/// neither a level nor a library with a level.
fn levels(chosen: &str) -> Option<Targets> {
    let items: Vec<&str> =
        chosen.split(',').map(str::trim).filter(|item| !item.is_empty()).collect();
    let is_readable = |item: &&str| {
        let level = item.split_once('=').map_or(*item, |(_, level)| level);
        !level.is_empty() && level.parse::<LevelFilter>().is_ok()
    };
    if items.is_empty() || !items.iter().all(is_readable) {
        return None;
    }
    format!("{QUIET},{}", items.join(",")).parse().ok()
}

/// Logs each silence of a port (time without frames) once, even if the port is reopened several
/// times meanwhile.
#[derive(Debug, Default)]
pub(crate) struct SilenceLog {
    /// Number of frames received before the last silence that was logged. As long as no further
    /// frame arrives, it is the same silence.
    frames: Option<u32>,
}

impl SilenceLog {
    /// Logs that no frame arrives from `port`, unless this silence is logged already. `wire` holds
    /// the counts of bytes and frames received from the port.
    pub(crate) fn log(&mut self, port: &str, wire: &Counters) {
        if self.frames.replace(wire.frames) == Some(wire.frames) {
            return;
        }
        if wire.frames == 0 {
            tracing::error!(
                "nothing here speaks Corticode: {port} sent {} bytes and no frame; check that \
                 --port names the board's port, that --baud is the board's, and that the board \
                 runs Corticode's firmware; trying again without further messages",
                wire.bytes
            );
        } else {
            tracing::warn!(
                "the device at {port} is silent; waiting for it, and reopening the port if it stays silent"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use tracing::Level;

    use super::*;

    #[test]
    fn the_later_of_two_levels_counts_and_an_unreadable_choice_is_none() {
        let chosen = levels(" info, ros1=debug,").expect("levels");
        assert!(chosen.would_enable("bridge", &Level::INFO));
        assert!(!chosen.would_enable("bridge", &Level::DEBUG));
        assert!(chosen.would_enable("ros1::node", &Level::DEBUG));
        assert!(!chosen.would_enable("rustdds::dds", &Level::WARN));
        let verbose = levels("rustdds=debug").expect("levels");
        assert!(verbose.would_enable("rustdds::dds", &Level::DEBUG));
        for unreadable in ["", ", ", "warning", "ros1", "ros1=", "ros1=loud", "info,loud"] {
            assert_eq!(levels(unreadable), None, "{unreadable:?}");
        }
    }
}
