//! The bridge's ROS node: namespace, services and registration.

use std::sync::Arc;

use link::MAX_RATE;
use neuro_ros::ros1::{Node, NodeError, NodeOptions};
use neuro_ros::{
    AcquisitionCommand, AcquisitionInfo, AcquisitionServices, RosMessage, UInt8, Wire,
};
use tokio::sync::mpsc::UnboundedSender;
use tokio::sync::watch::Receiver;

use crate::app::recorders::Recorders;
use crate::app::ros_status::RosStatus;

/// Topic on which an experiment sets the rate of the packed code.
const RATE_TOPIC: &str = "~packed_rate";
/// Number of received rates that can wait to be handled; a further rate replaces the oldest.
const QUEUE_RATES: usize = 4;

#[derive(Debug)]
pub(crate) struct RosNode {
    pub(crate) node: Arc<Node>,
    pub(crate) status: Arc<RosStatus>,
}

impl RosNode {
    pub(crate) async fn start(options: NodeOptions) -> Result<RosNode, NodeError> {
        let node = Arc::new(Node::start(options.clone()).await?);
        tracing::info!("node {} at {}", node.name(), node.uri());
        let status = Arc::new(RosStatus::watch(Arc::clone(&node), &options));
        Ok(RosNode { node, status })
    }

    /// Stops watching the node, unregisters topics and services, and closes all connections.
    pub(crate) async fn shutdown(self) {
        self.status.stop();
        self.node.shutdown().await;
    }

    /// Passes the rates that arrive on `~packed_rate` to `commands`. Runs in a task of its own,
    /// because registration at the master can take long.
    pub(crate) fn subscribe_rate(&self, commands: UnboundedSender<NodeCommand>) {
        tokio::spawn(receive_rates(Arc::clone(&self.node), commands));
    }

    /// Serves the newest announcement as `get_info` in `namespace`, and notes its callers in
    /// `recorders`. Passes calls of `~start`, `~stop` and `~quit` to `commands`. Runs in a task of
    /// its own, because registration at the master can take long.
    ///
    /// Before the first announcement a call of `get_info` fails: rosneuro_recorder repeats a failed
    /// call, but would accept an answer that describes no frame.
    pub(crate) fn serve(
        &self,
        namespace: &Namespace,
        get_info: &str,
        announced: Receiver<Option<AcquisitionInfo>>,
        recorders: Option<Arc<Recorders>>,
        commands: UnboundedSender<NodeCommand>,
    ) {
        let node = Arc::clone(&self.node);
        let get_info = if get_info.starts_with('~') {
            get_info.to_owned()
        } else {
            namespace.resolve(get_info)
        };
        tokio::spawn(async move {
            let on_info = move |caller: &str| {
                let info = announced.borrow().clone();
                let info = info.ok_or_else(|| {
                    "no device has introduced itself yet, or what --announce names is not published; see the log of \
                     the bridge, and try again"
                        .to_owned()
                })?;
                if let Some(recorders) = &recorders {
                    recorders.note_call(caller);
                }
                Ok(info)
            };
            let on_command = move |command| {
                tracing::info!("{} was called", command_name(command));
                commands
                    .send(NodeCommand::Acquisition(command))
                    .map_err(|_| "the bridge is shutting down".to_owned())
            };
            let services = AcquisitionServices::serve(&node, &get_info, on_info, on_command).await;
            match services {
                // Keeps the services until the node shuts down; dropping them unregisters them.
                Ok(_services) => std::future::pending().await,
                Err(error) => tracing::error!(
                    %error,
                    "services are not registered; recorders cannot find this acquisition"
                ),
            }
        });
    }
}

/// Passes each rate that arrives on `~packed_rate` to `commands`. Logs a warning for an invalid
/// rate.
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

pub(crate) fn command_name(command: AcquisitionCommand) -> &'static str {
    match command {
        AcquisitionCommand::Start => "~start",
        AcquisitionCommand::Stop => "~stop",
        AcquisitionCommand::Quit => "~quit",
    }
}

/// Namespace of topics and services: ROS's namespace (`ROS_NAMESPACE` or `__ns:=`), extended or
/// replaced by `--topic-prefix`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Namespace {
    /// Full name without a slash at its end; empty for the namespace `/`.
    name: String,
}

impl Namespace {
    /// Joins ROS's namespace `ros` and `prefix`. A prefix that starts with a slash replaces `ros`.
    pub fn new(ros: &str, prefix: &str) -> Namespace {
        let joined =
            if prefix.starts_with('/') { prefix.to_owned() } else { format!("{ros}/{prefix}") };
        let parts = joined.split('/').filter(|part| !part.is_empty());
        let name = parts.fold(String::new(), |name, part| format!("{name}/{part}"));
        Namespace { name }
    }

    /// Returns the namespace as a ROS name, such as `/left` or `/`.
    pub fn as_ros_name(&self) -> &str {
        if self.name.is_empty() { "/" } else { &self.name }
    }

    /// Returns the full name of `name` in this namespace: `/left/encoded` for `encoded` and
    /// `/encoded`.
    pub fn resolve(&self, name: &str) -> String {
        format!("{}/{}", self.name, name.trim_start_matches('/'))
    }

    /// Returns the name of a status with the namespace in it, because all bridges share the topic
    /// `/diagnostics`: `corticode: link` becomes `corticode /left: link`.
    pub fn status_name(&self, name: &str) -> String {
        match name.split_once(": ") {
            Some((program, part)) if !self.name.is_empty() => {
                format!("{program} {}: {part}", self.name)
            }
            _ => name.to_owned(),
        }
    }
}

/// A request to the bridge from another ROS node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NodeCommand {
    /// A call of `~start`, `~stop` or `~quit`.
    Acquisition(AcquisitionCommand),
    /// A message on `~packed_rate`: the rate that the packed code shall have.
    PackedRate(u8),
}

#[cfg(test)]
mod tests {
    use super::Namespace;

    #[test]
    fn without_a_namespace_all_names_are_those_that_rosneuro_asks_for() {
        for (ros, prefix) in [("/", ""), ("", ""), ("/", "/")] {
            let none = Namespace::new(ros, prefix);
            assert_eq!(none.as_ros_name(), "/");
            let get_info = "/acquisition/get_info";
            assert_eq!(none.resolve(get_info), get_info);
            assert_eq!(none.status_name("corticode: link"), "corticode: link");
        }
    }

    #[test]
    fn a_prefix_extends_the_namespace_and_an_absolute_one_replaces_it() {
        for (ros, prefix, expected) in
            [("/lab", "", "/lab"), ("lab", "left", "/lab/left"), ("/lab", "/left/", "/left")]
        {
            let namespace = Namespace::new(ros, prefix);
            assert_eq!(namespace.as_ros_name(), expected);
            assert_eq!(namespace.resolve("encoded"), format!("{expected}/encoded"));
            let status = format!("corticode {expected}: link");
            assert_eq!(namespace.status_name("corticode: link"), status);
        }
    }
}
