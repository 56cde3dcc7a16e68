//! What makes the bridge leave.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use neuro_ros::ros1::Node;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

/// A closing terminal sends several signals at once; a later one comes from someone who does not
/// want to wait any more.
const FORCE_EXIT_AFTER: Duration = Duration::from_millis(500);

/// What makes the bridge leave: signals, the ROS master, a service.
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
            (SignalKind::hangup(), "the terminal has gone"),
        ] {
            let mut signals = signal(kind)?;
            let reason_sender = reason_sender.clone();
            let first = Arc::clone(&first);
            tokio::spawn(async move {
                while signals.recv().await.is_some() {
                    let first: &Instant = first.get_or_init(Instant::now);
                    if first.elapsed() > FORCE_EXIT_AFTER {
                        tracing::error!("asked again ({reason}): leaving at once");
                        std::process::exit(1);
                    }
                    // An error means that the bridge is leaving; a second signal still counts.
                    let _ = reason_sender.send(reason);
                }
            });
        }
        Ok(Shutdown {
            reason_sender,
            reasons,
        })
    }

    /// Shutdown when the master says so.
    pub(crate) fn watch_node(&self, node: Arc<Node>) {
        let reason_sender = self.reason_sender.clone();
        tokio::spawn(async move {
            node.shutdown_requested().await;
            // An error means that the bridge has left already.
            let _ = reason_sender.send("the ROS master asks this node to leave");
        });
    }

    pub(crate) fn request(&self, reason: &'static str) {
        // Cannot fail: the receiving end is beside it.
        let _ = self.reason_sender.send(reason);
    }

    /// The next reason to leave. Safe to cancel.
    pub(crate) async fn requested(&mut self) -> &'static str {
        match self.reasons.recv().await {
            Some(reason) => reason,
            // Cannot happen: the sending end is beside it.
            None => std::future::pending().await,
        }
    }
}
