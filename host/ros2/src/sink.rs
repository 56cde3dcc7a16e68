//! Sinks that publish on ROS 2 topics.

use std::sync::Arc;

use neuro_ros::{Sink, SinkError};
use ros2_client::QosProfile;
use ros2_client::qos::{Durability, History, WhenFull};

use crate::messages::Ros2Message;
use crate::topic::Topic;

/// Number of messages of a topic that are kept while they are sent. If more are published at once,
/// such as fillers after an outage of 16 s, best-effort subscribers can miss the oldest. For
/// reliable subscribers, every message is kept until they have acknowledged it.
const DEPTH: usize = 256;

/// What a topic promises its subscribers: its reliability and durability, as ROS 2 names them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Reliable and volatile: lost packets are sent again. Serves reliable and best-effort
    /// subscribers.
    Reliable,
    /// Best effort and volatile, as for sensor data: a lost packet is a lost message. Reliable
    /// subscribers receive nothing.
    BestEffort,
    /// Reliable and transient local, depth 1: a late subscriber receives the newest message.
    Latched,
}

impl Delivery {
    pub(crate) fn qos(self) -> QosProfile {
        let qos = QosProfile::publisher_default();
        let (reliable, depth) = match self {
            Delivery::Reliable => (true, DEPTH),
            Delivery::BestEffort => (false, DEPTH),
            Delivery::Latched => (true, 1),
        };
        let qos = qos.history(History::KeepLast { depth });
        let qos = match self {
            Delivery::Latched => qos.durability(Durability::TransientLocal),
            Delivery::Reliable | Delivery::BestEffort => qos.durability(Durability::Volatile),
        };
        if reliable {
            qos.reliability_reliable(WhenFull::Fail)
        } else {
            qos.reliability_best_effort()
        }
    }
}

/// Sink for the messages of one topic; created by [`Ros2Node::sink`](crate::Ros2Node::sink).
///
/// [`Sink::publish`] never waits. A message is dropped, for all subscribers, if a reliable
/// subscriber has acknowledged none of the newest 8192. A subscriber whose process is stopped is
/// removed after its lease, 10 to 20 s for usual ROS 2 nodes, without any loss for the others. If
/// the node's own process was stopped, up to 8192 messages wait until subscribers are back; later
/// ones are dropped.
pub struct Ros2Sink<M: Ros2Message>(pub(crate) Arc<Topic<M>>);

impl<M: Ros2Message> Sink<M> for Ros2Sink<M> {
    /// Succeeds without subscribers, too.
    fn publish(&mut self, message: &M) -> Result<(), SinkError> {
        self.0.publish(message.into())
    }

    fn dropped(&self) -> u64 {
        self.0.dropped()
    }

    fn has_receivers(&self) -> bool {
        self.0.has_subscribers()
    }
}
