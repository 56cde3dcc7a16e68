//! The bridge's ROS node: topics, services and registration.

use std::sync::Arc;
use std::time::Duration;

use link::MAX_RATE;
use neuro_ros::ros1::{Node, NodeError, NodeOptions};
use neuro_ros::{
    AcquisitionCommand, AcquisitionInfo, AcquisitionServices, RosMessage, UInt8, Wire,
};
use tokio::sync::mpsc::UnboundedSender;
use tokio::sync::watch::Receiver;
use tokio::task::JoinHandle;

use crate::app::namespace::Namespace;
use crate::app::node_command::NodeCommand;

/// Time after the node's start at which a missing ROS master is first logged.
const REGISTRATION_GRACE: Duration = Duration::from_secs(1);

/// Topic with the rate that the packed code is to have from now on.
const RATE_TOPIC: &str = "~packed_rate";
/// Rates that wait to be handled; the newest one counts.
const QUEUE_RATES: usize = 4;

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

    /// Sends the rates that arrive on `~packed_rate` to `commands`. Runs in a task of its own, because registration
    /// can take long.
    pub(crate) fn subscribe_rate(&self, commands: UnboundedSender<NodeCommand>) {
        tokio::spawn(receive_rates(Arc::clone(&self.node), commands));
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
        commands: UnboundedSender<NodeCommand>,
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
                info.ok_or_else(|| {
                    "no device has introduced itself yet, or what --announce names is not published; see the log of \
                     the bridge, and try again"
                        .to_owned()
                })
            };
            let on_command = move |command| {
                tracing::info!("{} was called", command_name(command));
                commands
                    .send(NodeCommand::Acquisition(command))
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

/// Sends each number that arrives on `~packed_rate` to `commands`. Other numbers than rates are refused in the log.
async fn receive_rates(node: Arc<Node>, commands: UnboundedSender<NodeCommand>) {
    let subscribed = node.subscribe(RATE_TOPIC, UInt8::TYPE, QUEUE_RATES).await;
    let mut rates = match subscribed {
        Ok(rates) => rates,
        Err(error) => {
            tracing::error!(%error, "{RATE_TOPIC} is not subscribed; the rate stays as it is");
            return;
        }
    };
    while let Some(body) = rates.recv().await {
        match UInt8::from_bytes(&body) {
            Ok(UInt8 { data }) if data <= MAX_RATE => {
                tracing::info!("rate {data} of the packed code, from {RATE_TOPIC}");
                if commands.send(NodeCommand::PackedRate(data)).is_err() {
                    return;
                }
            }
            Ok(UInt8 { data }) => {
                tracing::warn!("{RATE_TOPIC}: {data} is no rate; publish 0 to {MAX_RATE}");
            }
            Err(error) => tracing::warn!(%error, "{RATE_TOPIC}: a message cannot be read"),
        }
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
