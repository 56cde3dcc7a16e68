//! The log of a program that is a ROS node: on stderr, in a file and on `/rosout`.

use std::fmt::Write;
use std::fs::File;
use std::sync::Arc;
use std::time::Duration;

use link::Counters;
use neuro_ros::ros1::{Node, NodeOptions, PublisherOptions};
use neuro_ros::{Header, Log, RosMessage, Stamp, Wire};
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::writer::{BoxMakeWriter, MakeWriterExt};
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

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

/// Maximum number of lines that wait to be published, and that wait for each subscriber. Lines
/// beyond it are only on stderr.
const QUEUE_LINES: usize = 1024;
/// Longest time for which the first lines wait for a subscriber, which needs several milliseconds
/// to connect.
const FIRST_SUBSCRIBER_TIMEOUT: Duration = Duration::from_secs(5);

/// Passes the lines of the log at the level of information and above to [`publish`].
#[derive(Debug)]
pub(crate) struct RosoutLayer {
    lines: Sender<Log>,
}

impl RosoutLayer {
    /// Creates the layer, and the receiver of its lines.
    pub(crate) fn new() -> (RosoutLayer, Receiver<Log>) {
        let (lines, receiver) = channel(QUEUE_LINES);
        (RosoutLayer { lines }, receiver)
    }
}

impl<S: Subscriber> Layer<S> for RosoutLayer {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        let metadata = event.metadata();
        let level = match *metadata.level() {
            Level::ERROR => Log::ERROR,
            Level::WARN => Log::WARN,
            Level::INFO => Log::INFO,
            _ => return,
        };
        let mut text = Text::default();
        event.record(&mut text);
        let stamp = Stamp::now();
        let line = Log {
            header: Header {
                stamp,
                ..Header::default()
            },
            level,
            msg: text.message + &text.fields,
            file: metadata.file().unwrap_or_default().to_owned(),
            function: metadata.target().to_owned(),
            line: metadata.line().unwrap_or_default(),
            ..Log::default()
        };
        // Sending fails if too many lines wait, or without a ROS node; stderr has every line.
        let _ = self.lines.try_send(line);
    }
}

/// Text of an event: its message, then its other fields.
#[derive(Default)]
struct Text {
    message: String,
    fields: String,
}

impl Visit for Text {
    fn record_str(&mut self, field: &Field, value: &str) {
        self.record_debug(field, &format_args!("{value}"));
    }

    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        // Writing to a string does not fail.
        let _ = if field.name() == "message" {
            write!(self.message, "{value:?}")
        } else {
            write!(self.fields, " {}={value:?}", field.name())
        };
    }
}

/// Publishes the lines on `/rosout` in a task of its own.
pub(crate) fn publish(node: Arc<Node>, mut lines: Receiver<Log>) {
    tokio::spawn(async move {
        let options = PublisherOptions {
            queue: QUEUE_LINES,
            latch: false,
        };
        let publisher = match node.advertise("/rosout", Log::TYPE, options).await {
            Ok(publisher) => publisher,
            Err(error) => {
                tracing::warn!(%error, "the log is not on /rosout");
                return;
            }
        };
        let connected = async {
            while publisher.subscribers() == 0 {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        };
        // Without a subscriber the lines are not needed.
        let _ = tokio::time::timeout(FIRST_SUBSCRIBER_TIMEOUT, connected).await;
        let mut seq = 0;
        while let Some(mut line) = lines.recv().await {
            seq += 1;
            line.header.seq = seq;
            node.name().clone_into(&mut line.name);
            publisher.publish(&line.to_bytes());
        }
    });
}

/// Logs each silence of a port once, however often the port is reopened.
#[derive(Debug, Default)]
pub(crate) struct SilenceLog {
    /// Number of frames received when the last silence was logged.
    frames: Option<u32>,
}

impl SilenceLog {
    /// Logs a silence, unless it is the one that was logged last.
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
