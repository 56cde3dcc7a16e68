//! Publishes the log of the bridge on the topic `/rosout`.

use std::fmt::Write;
use std::sync::Arc;
use std::time::Duration;

use neuro_ros::ros1::{Node, PublisherOptions};
use neuro_ros::{Header, Log, RosMessage, Stamp, Wire};
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

/// Number of log lines that can wait to be published, and that can wait for each subscriber. Lines
/// that do not fit are only on stderr.
const QUEUE_LINES: usize = 1024;
/// Longest time for which the first log lines wait for a subscriber, which takes several ms to
/// connect.
const FIRST_SUBSCRIBER_TIMEOUT: Duration = Duration::from_secs(5);

/// A layer of the log that passes lines of level info and above to the task of [`publish`].
#[derive(Debug)]
pub(crate) struct RosoutLayer {
    lines: Sender<Log>,
}

impl RosoutLayer {
    /// Creates the layer, and the receiver of the lines that it passes on.
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
            header: Header { stamp, ..Header::default() },
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

/// Text collected from a log event: the message, and all other fields.
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

/// Passes each log line to both returned receivers, in a task of its own. A receiver whose queue is
/// full misses the line.
pub(crate) fn split(mut lines: Receiver<Log>) -> [Receiver<Log>; 2] {
    let (senders, receivers): (Vec<_>, Vec<_>) = (0..2).map(|_| channel(QUEUE_LINES)).unzip();
    tokio::spawn(async move {
        while let Some(line) = lines.recv().await {
            for sender in &senders {
                let _ = sender.try_send(line.clone());
            }
        }
    });
    receivers.try_into().expect("two receivers")
}

/// Publishes the lines on `/rosout`, in a task of its own.
pub(crate) fn publish(node: Arc<Node>, mut lines: Receiver<Log>) {
    tokio::spawn(async move {
        let options = PublisherOptions { queue: QUEUE_LINES, latch: false };
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
        // If no subscriber connects in this time, the lines are published without one.
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
