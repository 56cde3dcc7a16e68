//! The destination ROS 1 topic.

use std::marker::PhantomData;

use ros1::{Node, NodeError, Publisher, PublisherOptions};

use crate::definition::RosMessage;
use crate::sink::{Sink, SinkError};

/// Sink that publishes on a ROS 1 topic. A slow subscriber loses its oldest messages; other
/// subscribers are not affected.
#[derive(Debug)]
pub struct RosSink<M> {
    publisher: Publisher,
    /// Buffer for the encoded message, kept to avoid an allocation per message.
    body: Vec<u8>,
    message: PhantomData<fn(M)>,
}

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
        let options = PublisherOptions {
            queue,
            latch: false,
        };
        let publisher = node.advertise(topic, M::TYPE, options).await?;
        Ok(RosSink {
            publisher,
            body: Vec::new(),
            message: PhantomData,
        })
    }

    /// Number of subscribers with an open connection.
    pub fn subscribers(&self) -> usize {
        self.publisher.subscribers()
    }

    /// The topic's publisher.
    pub fn publisher(&self) -> &Publisher {
        &self.publisher
    }
}

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
        self.subscribers() > 0
    }
}
