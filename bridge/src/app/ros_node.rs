//! The bridge's ROS node: topics, services and registration.

use std::sync::Arc;
use std::time::Duration;

use neuro_ros::ros1::{Node, NodeError, NodeOptions};
use neuro_ros::{AcquisitionCommand, AcquisitionInfo, AcquisitionServices, RosMessage, RosSink};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};
use tokio::sync::watch::Receiver;
use tokio::task::JoinHandle;

/// Time after the node's start at which a missing ROS master is first logged.
const REGISTRATION_GRACE: Duration = Duration::from_secs(1);

/// The bridge's ROS node, with a task that logs when the master appears or disappears.
#[derive(Debug)]
pub(crate) struct RosNode {
    pub(crate) node: Arc<Node>,
    master_log: JoinHandle<()>,
}

impl RosNode {
    pub(crate) async fn start(options: NodeOptions) -> Result<RosNode, NodeError> {
        let uri = options.master_uri.clone();
        let node = Arc::new(Node::start(options).await?);
        tracing::info!("node {} at {}", node.name(), node.uri());
        let master_log = tokio::spawn(log_master_changes(node.master_online(), uri));
        Ok(RosNode { node, master_log })
    }

    /// Unregisters topics and services and closes all connections.
    pub(crate) async fn shutdown(self) {
        self.master_log.abort();
        self.node.shutdown().await;
    }

    /// Advertises a topic with a queue of `queue` messages for each subscriber.
    pub(crate) async fn sink<M: RosMessage>(
        &self,
        topic: &str,
        queue: usize,
    ) -> Result<RosSink<M>, NodeError> {
        RosSink::advertise(&self.node, topic, queue).await
    }

    /// Serves `/acquisition/get_info` with the newest announcement, and sends calls of `~start`,
    /// `~stop` and `~quit` to `commands`. Runs in a task of its own, because registration can take
    /// long.
    pub(crate) fn serve_announcements(
        &self,
        mut announcements: UnboundedReceiver<AcquisitionInfo>,
        commands: UnboundedSender<AcquisitionCommand>,
    ) {
        let node = Arc::clone(&self.node);
        tokio::spawn(async move {
            let mut services: Option<AcquisitionServices> = None;
            while let Some(info) = announcements.recv().await {
                drop(services.take());
                let commands = commands.clone();
                let on_command = move |command| {
                    commands
                        .send(command)
                        .map_err(|_| "the bridge is shutting down".to_owned())
                };
                match AcquisitionServices::serve(&node, &info, on_command).await {
                    Ok(new) => services = Some(new),
                    Err(error) => tracing::error!(
                        %error,
                        "services are not registered; recorders cannot find this acquisition"
                    ),
                }
            }
        });
    }
}

/// Logs when the ROS master appears or disappears. The first message waits for
/// [`REGISTRATION_GRACE`], because even a running master takes several milliseconds to answer.
async fn log_master_changes(mut online: Receiver<bool>, uri: String) {
    let mut logged = None;
    tokio::time::sleep(REGISTRATION_GRACE).await;
    loop {
        let now = *online.borrow_and_update();
        if logged != Some(now) {
            logged = Some(now);
            if now {
                tracing::info!("registered with the ROS master at {uri}");
            } else {
                tracing::warn!(
                    "no ROS master answers at {uri}; waiting for it: start roscore, or set \
                     --ros-master-uri"
                );
            }
        }
        if online.changed().await.is_err() {
            return;
        }
    }
}
