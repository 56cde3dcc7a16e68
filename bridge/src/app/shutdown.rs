//! What makes the bridge leave.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use neuro_ros::ros1::Node;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

/// A closing terminal sends several signals at once; a later one comes from someone who does not
/// want to wait any more.
const INSISTS_AFTER: Duration = Duration::from_millis(500);

/// What makes the bridge leave: signals, the ROS master, a service.
#[derive(Debug)]
pub(crate) struct Leave {
    reasons_in: UnboundedSender<&'static str>,
    reasons: UnboundedReceiver<&'static str>,
}

impl Leave {
    pub(crate) fn new() -> std::io::Result<Leave> {
        let (reasons_in, reasons) = unbounded_channel();
        let first = Arc::new(OnceLock::new());
        for (kind, reason) in [
            (SignalKind::interrupt(), "interrupted"),
            (SignalKind::terminate(), "terminated"),
            (SignalKind::hangup(), "the terminal has gone"),
        ] {
            let mut signals = signal(kind)?;
            let reasons_in = reasons_in.clone();
            let first = Arc::clone(&first);
            tokio::spawn(async move {
                while signals.recv().await.is_some() {
                    let first: &Instant = first.get_or_init(Instant::now);
                    if first.elapsed() > INSISTS_AFTER {
                        tracing::error!("asked again ({reason}): leaving at once");
                        std::process::exit(1);
                    }
                    // An error means that the bridge is leaving; a second signal still counts.
                    let _ = reasons_in.send(reason);
                }
            });
        }
        Ok(Leave {
            reasons_in,
            reasons,
        })
    }

    /// Leave when the master says so.
    pub(crate) fn watch(&self, node: Arc<Node>) {
        let reasons_in = self.reasons_in.clone();
        tokio::spawn(async move {
            node.shutdown_requested().await;
            // An error means that the bridge has left already.
            let _ = reasons_in.send("the ROS master asks this node to leave");
        });
    }

    pub(crate) fn now(&self, reason: &'static str) {
        // Cannot fail: the receiving end is beside it.
        let _ = self.reasons_in.send(reason);
    }

    /// The next reason to leave. Safe to cancel.
    pub(crate) async fn asked(&mut self) -> &'static str {
        match self.reasons.recv().await {
            Some(reason) => reason,
            // Cannot happen: the sending end is beside it.
            None => std::future::pending().await,
        }
    }
}
