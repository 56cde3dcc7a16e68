//! The bridge's ROS node: topics, services and registration.

use std::sync::Arc;
use std::time::Duration;

use neuro_ros::ros1::{Node, NodeError, NodeOptions};
use neuro_ros::{AcquisitionCommand, AcquisitionInfo, AcquisitionServices};
use tokio::sync::mpsc::UnboundedSender;
use tokio::sync::watch::Receiver;
use tokio::task::JoinHandle;

use crate::app::namespace::Namespace;

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

    /// Serves the newest announcement as `get_info` in `namespace`, and sends calls of
    /// `~start`, `~stop` and `~quit` to `commands`. Runs in a task of its own, because registration
    /// can take long.
    ///
    /// Before the first announcement a call of `get_info` fails: rosneuro_recorder repeats a failed
    /// call, but would accept an answer without a frame.
    pub(crate) fn serve(
        &self,
        namespace: &Namespace,
        get_info: &str,
        announced: Receiver<Option<AcquisitionInfo>>,
        commands: UnboundedSender<AcquisitionCommand>,
    ) {
        let node = Arc::clone(&self.node);
        let get_info = if get_info.starts_with('~') {
            get_info.to_owned()
        } else {
            namespace.resolve(get_info)
        };
        tokio::spawn(async move {
            let on_info = move || {
                let info = announced.borrow().clone();
                info.ok_or_else(|| "no device has introduced itself yet; try again".to_owned())
            };
            let on_command = move |command| {
                tracing::info!("{} was called", command_name(command));
                commands
                    .send(command)
                    .map_err(|_| "the bridge is shutting down".to_owned())
            };
            let services = AcquisitionServices::serve(&node, &get_info, on_info, on_command).await;
            match services {
                // Dropping the services would unregister them; they are served until the node shuts
                // down.
                Ok(_services) => std::future::pending().await,
                Err(error) => tracing::error!(
                    %error,
                    "services are not registered; recorders cannot find this acquisition"
                ),
            }
        });
    }
}

fn command_name(command: AcquisitionCommand) -> &'static str {
    match command {
        AcquisitionCommand::Start => "~start",
        AcquisitionCommand::Stop => "~stop",
        AcquisitionCommand::Quit => "~quit",
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
