//! The interface through which messages are delivered to any destination, and its implementation
//! for ROS 1 topics.

#[cfg(feature = "ros1")]
use ros1::{Node, NodeError, Publisher, PublisherOptions};
use thiserror::Error;

#[cfg(feature = "ros1")]
use crate::definition::RosMessage;
use crate::rosneuro_msgs::NeuroFrame;

/// Destination of messages of one type.
pub trait Sink<M>: Send {
    /// Queues a message for delivery without waiting. If a receiver is too slow, messages are
    /// dropped and counted.
    ///
    /// # Errors
    ///
    /// [`SinkError`] if the sink cannot deliver any further message.
    fn publish(&mut self, message: &M) -> Result<(), SinkError>;

    /// Number of messages dropped because a receiver was too slow.
    fn dropped(&self) -> u64;

    /// Returns whether a message published now would reach anyone. Sinks that cannot tell return
    /// true.
    fn has_receivers(&self) -> bool {
        true
    }
}

/// A sink for [`NeuroFrame`]s. The trait exists to shorten the trait object `dyn Sink<NeuroFrame>`.
pub trait FrameSink: Sink<NeuroFrame> {}

impl<S: Sink<NeuroFrame>> FrameSink for S {}

/// Why a sink cannot deliver any further message.
#[derive(Debug, Error)]
pub enum SinkError {
    /// The reader has closed its end of the output.
    #[error("the reader has closed the output")]
    Closed,
    /// The time limit expired before all queued lines were written. The field is the number of
    /// lines that were not written.
    #[error("the reader does not read the output; {0} lines are lost")]
    Stuck(usize),
    /// The disk of the output has no room for another line.
    #[error("the disk of the output is full; free some space, or write to another disk")]
    DiskFull,
    /// Writing to the output failed.
    #[error("the output cannot be written; check the file or the disk: {0}")]
    Output(#[from] std::io::Error),
}

/// Sink that publishes on a ROS 1 topic. A slow subscriber loses its oldest messages; other
/// subscribers are not affected.
#[cfg(feature = "ros1")]
#[derive(Debug)]
pub struct RosSink<M> {
    publisher: Publisher,
    /// Buffer for the encoded message, reused to avoid an allocation per message.
    body: Vec<u8>,
    message: std::marker::PhantomData<fn(M)>,
}

#[cfg(feature = "ros1")]
impl<M: RosMessage> RosSink<M> {
    /// Advertises `topic` on `node` with a queue of `queue` messages per subscriber.
    ///
    /// # Errors
    ///
    /// [`NodeError`] if the name is invalid, the node already publishes the topic, or the master
    /// refuses the topic.
    pub async fn advertise(
        node: &Node,
        topic: &str,
        queue: usize,
    ) -> Result<RosSink<M>, NodeError> {
        let options = PublisherOptions { queue, latch: false };
        let publisher = node.advertise(topic, M::TYPE, options).await?;
        Ok(RosSink { publisher, body: Vec::new(), message: std::marker::PhantomData })
    }

    /// Returns the topic's publisher, which counts the subscribers and the dropped messages.
    pub fn publisher(&self) -> &Publisher {
        &self.publisher
    }

    /// Queues `message` for every subscriber. `own` receives each subscriber's name and can return
    /// a different message for that subscriber.
    pub fn publish_each(&mut self, message: &M, mut own: impl FnMut(&str) -> Option<M>) {
        self.body.clear();
        message.write(&mut self.body);
        let own = |subscriber: &str| Some(own(subscriber)?.to_bytes());
        self.publisher.publish_each(&self.body, own);
    }
}

#[cfg(feature = "ros1")]
impl<M: RosMessage> Sink<M> for RosSink<M> {
    /// Queues the message for every subscriber. Never fails, even without subscribers or without a
    /// master.
    fn publish(&mut self, message: &M) -> Result<(), SinkError> {
        self.body.clear();
        message.write(&mut self.body);
        self.publisher.publish(&self.body);
        Ok(())
    }

    fn dropped(&self) -> u64 {
        self.publisher.dropped()
    }

    fn has_receivers(&self) -> bool {
        self.publisher.subscribers() > 0
    }
}
