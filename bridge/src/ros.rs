//! The bridge as a ROS node.

use std::sync::Arc;

use neuro_ros::ros1::{Node, NodeError, NodeOptions};
use neuro_ros::{AcquisitionCommand, AcquisitionInfo, AcquisitionServices, RosMessage, RosSink};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender};

/// Frames that may wait for each subscriber: 8 min at 16 Hz, so that even the fillers of a long
/// outage, which come at once, reach a recorder. About 3 KB each, and only if one is slow.
const QUEUE_FRAMES: usize = 8192;

/// The bridge as a ROS node.
#[derive(Debug)]
pub(crate) struct Ros {
    pub(crate) node: Arc<Node>,
}

impl Ros {
    pub(crate) async fn start(options: NodeOptions) -> Result<Ros, NodeError> {
        let uri = options.master_uri.clone();
        let node = Arc::new(Node::start(options).await?);
        tracing::info!("node {} at {}", node.name(), node.uri());
        tokio::spawn(tell_of_master(Arc::clone(&node), uri));
        Ok(Ros { node })
    }

    pub(crate) async fn sink<M: RosMessage>(&self, topic: &str) -> Result<RosSink<M>, NodeError> {
        RosSink::advertise(&self.node, topic, QUEUE_FRAMES).await
    }

    /// Serve the newest announcement, beside the link, because registering it may take time.
    pub(crate) fn serve(
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
                        .map_err(|_| "the bridge is leaving".to_owned())
                };
                match AcquisitionServices::serve(&node, &info, on_command).await {
                    Ok(new) => services = Some(new),
                    Err(error) => tracing::error!(
                        %error,
                        "recorders will not find this acquisition: its services cannot be served"
                    ),
                }
            }
        });
    }
}

async fn tell_of_master(node: Arc<Node>, uri: String) {
    let mut online = node.master_online();
    drop(node);
    loop {
        if *online.borrow_and_update() {
            tracing::info!("registered with the ROS master at {uri}");
        } else {
            tracing::warn!(
                "no ROS master answers at {uri} yet; frames wait for nobody. Start roscore, or \
                 give --ros-master-uri"
            );
        }
        if online.changed().await.is_err() {
            return;
        }
    }
}
