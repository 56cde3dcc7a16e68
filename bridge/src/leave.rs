//! What makes the bridge leave.

use std::sync::Arc;

use neuro_ros::ros1::Node;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};

/// What makes the bridge leave: signals, the ROS master, a service.
#[derive(Debug)]
pub(crate) struct Leave {
    reasons_in: UnboundedSender<&'static str>,
    reasons: UnboundedReceiver<&'static str>,
}

impl Leave {
    pub(crate) fn new() -> std::io::Result<Leave> {
        let (reasons_in, reasons) = unbounded_channel();
        for (kind, reason) in [
            (SignalKind::interrupt(), "interrupted"),
            (SignalKind::terminate(), "terminated"),
            (SignalKind::hangup(), "the terminal has gone"),
        ] {
            let mut signals = signal(kind)?;
            let reasons_in = reasons_in.clone();
            tokio::spawn(async move {
                while signals.recv().await.is_some() && reasons_in.send(reason).is_ok() {}
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
