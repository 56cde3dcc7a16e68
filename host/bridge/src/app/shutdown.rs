//! Requests to shut down the bridge.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use neuro_ros::ros1::Node;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

/// A Unix signal that arrives at least this long after the first signal ends the process at once,
/// because the user will not wait. Earlier signals do not: a closing terminal sends several signals
/// in a short time.
const FORCE_EXIT_AFTER: Duration = Duration::from_millis(500);

/// Collects requests to shut down from Unix signals, the ROS master and the service `~quit`.
#[derive(Debug)]
pub(crate) struct Shutdown {
    reason_sender: UnboundedSender<&'static str>,
    reasons: UnboundedReceiver<&'static str>,
}

impl Shutdown {
    pub(crate) fn new() -> std::io::Result<Shutdown> {
        let (reason_sender, reasons) = unbounded_channel();
        let first = Arc::new(OnceLock::new());
        for (kind, reason) in [
            (SignalKind::interrupt(), "interrupted"),
            (SignalKind::terminate(), "terminated"),
            (SignalKind::hangup(), "the terminal was closed"),
        ] {
            let mut signals = signal(kind)?;
            let reason_sender = reason_sender.clone();
            let first = Arc::clone(&first);
            tokio::spawn(async move {
                while signals.recv().await.is_some() {
                    let first: &Instant = first.get_or_init(Instant::now);
                    if first.elapsed() > FORCE_EXIT_AFTER {
                        tracing::error!("second signal ({reason}): exiting at once");
                        std::process::exit(1);
                    }
                    // Sending fails only if the bridge is already shutting down. The check above
                    // still handles a second signal.
                    let _ = reason_sender.send(reason);
                }
            });
        }
        Ok(Shutdown { reason_sender, reasons })
    }

    /// Requests a shutdown as soon as the ROS master asks `node` to shut down.
    pub(crate) fn watch_node(&self, node: Arc<Node>) {
        let reason_sender = self.reason_sender.clone();
        tokio::spawn(async move {
            node.shutdown_requested().await;
            tracing::warn!(
                "the ROS master asks this node to shut down, as it does when another node takes its \
                 name; --topic-prefix or __name:= lets two bridges run side by side"
            );
            // Sending fails only if the bridge has shut down already.
            let _ = reason_sender.send("the ROS master asks this node to shut down");
        });
    }

    pub(crate) fn request(&self, reason: &'static str) {
        // Sending cannot fail, because `self` holds the receiver.
        let _ = self.reason_sender.send(reason);
    }

    /// Waits for the next request to shut down and returns its reason. Cancel safe.
    pub(crate) async fn requested(&mut self) -> &'static str {
        match self.reasons.recv().await {
            Some(reason) => reason,
            // Unreachable, because `self` holds a sender and so keeps the channel open.
            None => std::future::pending().await,
        }
    }
}
