//! Messages to a ROS 1 topic.

use std::marker::PhantomData;

use ros1::{Node, NodeError, Publisher, PublisherOptions};

use crate::{RosMessage, Sink, SinkError};

/// Messages to a ROS 1 topic; a slow subscriber loses the oldest and nobody else notices.
#[derive(Debug)]
pub struct RosSink<M> {
    publisher: Publisher,
    /// The body being written; kept so that a running node does not allocate for it.
    body: Vec<u8>,
    message: PhantomData<fn(M)>,
}

impl<M: RosMessage> RosSink<M> {
    /// Offer `topic` on `node`; `queue` messages may wait for each subscriber.
    ///
    /// # Errors
    ///
    /// [`NodeError`] if the name is not a ROS name or the node offers the topic already.
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

    /// Subscribers that are linked now.
    pub fn subscribers(&self) -> usize {
        self.publisher.subscribers()
    }
}

impl<M: RosMessage> Sink<M> for RosSink<M> {
    /// Never fails: a topic without subscribers or without a master is still a topic.
    fn publish(&mut self, message: &M) -> Result<(), SinkError> {
        self.body.clear();
        message.write(&mut self.body);
        self.publisher.publish(&self.body);
        Ok(())
    }

    fn dropped(&self) -> u64 {
        self.publisher.dropped()
    }
}
