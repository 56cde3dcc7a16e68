//! ROS 2 as an outlet: the node, the names of its topics and services, and what it announces.

use std::sync::Arc;

use neuro_ros::ros1::{Names, NodeOptions};
use neuro_ros::{
    AcquisitionInfo, DiagnosticStatus, GET_INFO_SERVICE, Log, NeuroFrame, Sink, SinkError,
};
use ros2::{Delivery, Domain, Ros2Node, ServiceNames};
pub(crate) use ros2::{Ros2Error, Ros2Message};
use tokio::sync::mpsc::{Receiver, UnboundedSender};
use tokio::sync::watch;

use crate::app::command_line::{Ros2Options, Ros2Qos};
use crate::app::ros_node::{Namespace, NodeCommand, command_name};
use crate::error::BridgeError;

/// Topic of the newest announcement. It is latched, so that late subscribers receive it too.
const INFO_TOPIC: &str = "/acquisition/neurodata_info";

/// The bridge's ROS 2 node.
pub(crate) struct Ros2Outlet {
    node: Ros2Node,
    names: Names,
    frames: Delivery,
    info_topic: String,
}

impl Ros2Outlet {
    /// Starts the node with the name, namespace and remaps in `ros`. Calls of `~start`, `~stop` and
    /// `~quit` are sent to `commands`.
    pub(crate) fn start(
        ros: &NodeOptions,
        options: &Ros2Options,
        namespace: &Namespace,
        commands: UnboundedSender<NodeCommand>,
    ) -> Result<Arc<Ros2Outlet>, BridgeError> {
        let names = ros.names().map_err(neuro_ros::ros1::NodeError::from)?;
        let resolve = |name: &str| names.resolve(name).map_err(neuro_ros::ros1::NodeError::from);
        let services = ServiceNames {
            start: resolve("~start")?,
            stop: resolve("~stop")?,
            quit: resolve("~quit")?,
            get_info: resolve(&namespace.resolve(GET_INFO_SERVICE))?,
        };
        let domain = ros2_domain(options, |name| std::env::var(name).ok());
        let node = Ros2Node::start(names.node(), domain, &services, move |command| {
            tracing::info!("{} was called in ROS 2", command_name(command));
            // Sending fails only if the bridge is shutting down.
            let _ = commands.send(NodeCommand::Acquisition(command));
        })?;
        tracing::info!("ROS 2 node {} in domain {}", node.full_name(), domain.id);
        Ok(Arc::new(Ros2Outlet {
            info_topic: resolve(&namespace.resolve(INFO_TOPIC))?,
            node,
            names,
            frames: match options.ros2_qos {
                Ros2Qos::Reliable => Delivery::Reliable,
                Ros2Qos::SensorData => Delivery::BestEffort,
            },
        }))
    }

    /// Creates a sink for the topic `name` after remapping. Frames have the quality of service that
    /// the user has chosen; other messages are reliable.
    pub(crate) fn sink<M: Ros2Message + 'static>(
        &self,
        name: &str,
    ) -> Result<Box<dyn Sink<M>>, BridgeError> {
        let topic = self.names.resolve(name);
        let topic = topic.map_err(neuro_ros::ros1::NodeError::from)?;
        let is_frame = M::NAME == NeuroFrame::NAME;
        let delivery = if is_frame { self.frames } else { Delivery::Reliable };
        Ok(Box::new(self.node.sink(&topic, delivery)?))
    }

    /// Passes each announcement to the service `get_info`, and publishes its frame, latched for
    /// late subscribers. A frame of rate 0 means that no stream is announced any more.
    pub(crate) fn announce(
        self: &Arc<Self>,
        mut announced: watch::Receiver<Option<AcquisitionInfo>>,
    ) -> Result<(), BridgeError> {
        let mut sink = self.node.sink::<NeuroFrame>(&self.info_topic, Delivery::Latched)?;
        let outlet = Arc::clone(self);
        tokio::spawn(async move {
            while announced.changed().await.is_ok() {
                let info = announced.borrow_and_update().clone();
                let frame = info.as_ref().map(|info| info.frame().clone());
                log_failure(sink.publish(&frame.unwrap_or_default()));
                outlet.node.announce(info);
            }
        });
        Ok(())
    }

    /// Publishes the lines of the log on `/rosout`.
    pub(crate) fn publish_log(&self, mut lines: Receiver<Log>) -> Result<(), BridgeError> {
        let mut sink = self.node.sink::<Log>("/rosout", Delivery::Latched)?;
        // ROS 2 names a logger after its node, with dots in place of slashes.
        let name = self.node.full_name().trim_start_matches('/');
        let name = name.replace('/', ".");
        tokio::spawn(async move {
            while let Some(mut line) = lines.recv().await {
                line.name.clone_from(&name);
                if sink.publish(&line).is_err() {
                    return;
                }
            }
        });
        Ok(())
    }

    /// Returns the number of queued messages, which are lost if the bridge exits now.
    pub(crate) fn waiting(&self) -> u64 {
        self.node.waiting()
    }

    /// Returns the status for `/diagnostics`.
    pub(crate) fn status(&self) -> DiagnosticStatus {
        self.node.status()
    }
}

/// Returns whether the error is wrong usage, not a network failure.
pub(crate) const fn is_usage(error: &Ros2Error) -> bool {
    matches!(error, Ros2Error::Name(..) | Ros2Error::Domain(_))
}

fn log_failure(published: Result<(), SinkError>) {
    if let Err(error) = published {
        tracing::error!("the announcement is not published in ROS 2: {error}");
    }
}

/// Returns the domain that the options select. The environment can restrict discovery to this
/// machine, with `ROS_AUTOMATIC_DISCOVERY_RANGE` or, up to Humble, `ROS_LOCALHOST_ONLY`.
pub(crate) fn ros2_domain(
    options: &Ros2Options,
    variable: impl Fn(&str) -> Option<String>,
) -> Domain {
    let range = variable("ROS_AUTOMATIC_DISCOVERY_RANGE");
    let only = variable("ROS_LOCALHOST_ONLY");
    Domain {
        id: options.ros_domain_id.into(),
        localhost_only: matches!(range.as_deref(), Some("LOCALHOST" | "OFF"))
            || only.as_deref() == Some("1"),
    }
}
