//! A topic of the node, whose writer is replaced when the node joins its domain again.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use neuro_ros::SinkError;
use ros2_client::{MessageTypeName, Publisher, WriteError};
use rustdds::DomainParticipant;

use crate::domain::{Ros2Error, name};
use crate::messages::Ros2Message;
use crate::presence::Place;
use crate::sink::Delivery;

/// Largest number of messages of a topic that wait for the node to join its domain again; later
/// messages are dropped. A DDS writer stores up to the same number of messages for its subscribers.
const MAX_WAITING: usize = 8192;
/// If the newest beat is older than this, the process may have been stopped.
const STALE: Duration = Duration::from_secs(1);

/// Time of the newest sign of life of the node's thread. Messages wait while it is missing or old.
#[derive(Default)]
pub(crate) struct Pulse(Mutex<Option<Instant>>);

impl Pulse {
    pub(crate) fn beat(&self) {
        *lock(&self.0) = Some(Instant::now());
    }

    /// Makes messages wait until the next beat.
    pub(crate) fn pause(&self) {
        *lock(&self.0) = None;
    }

    pub(crate) fn is_fresh(&self) -> bool {
        lock(&self.0).is_some_and(|beat| beat.elapsed() < STALE)
    }
}

/// Numbers of a topic's subscribers and of its other publishers, as counted last.
#[derive(Default)]
pub(crate) struct Others {
    pub(crate) subscribers: AtomicUsize,
    pub(crate) publishers: AtomicUsize,
}

/// The operations on a topic that do not depend on the type of its messages.
pub(crate) trait AnyTopic: Send + Sync {
    fn name(&self) -> &str;
    /// Returns whether no other node may publish on the topic.
    fn is_exclusive(&self) -> bool;
    fn others(&self) -> &Others;
    /// Creates a writer in `place`, which replaces the previous writer.
    fn reopen(&self, place: &mut Place) -> Result<(), Ros2Error>;
    /// Publishes the oldest waiting messages, at most `most`.
    fn release(&self, most: usize) -> Result<(), SinkError>;
    /// Returns the number of messages that wait.
    fn waiting(&self) -> usize;
}

/// A topic of the node, with the writer that sends its messages.
pub(crate) struct Topic<M: Ros2Message> {
    name: String,
    delivery: Delivery,
    others: Others,
    pulse: Arc<Pulse>,
    writer: Mutex<Writer<M>>,
}

struct Writer<M: Ros2Message> {
    publisher: Publisher<M::Message>,
    /// Keeps the node in its domain as long as any sink exists. When the last sink is dropped, the
    /// node announces that it leaves.
    participant: DomainParticipant,
    waiting: VecDeque<M::Message>,
    /// The newest message of a [`Delivery::Latched`] topic.
    newest: Option<M::Message>,
    dropped: u64,
}

impl<M: Ros2Message> Topic<M> {
    pub(crate) fn create(
        place: &mut Place,
        name: &str,
        delivery: Delivery,
        pulse: Arc<Pulse>,
    ) -> Result<Topic<M>, Ros2Error> {
        let writer = Writer {
            publisher: publisher::<M>(place, name, delivery)?,
            participant: place.participant.clone(),
            waiting: VecDeque::new(),
            newest: None,
            dropped: 0,
        };
        Ok(Topic {
            name: name.to_owned(),
            delivery,
            others: Others::default(),
            pulse,
            writer: Mutex::new(writer),
        })
    }

    /// Publishes the message, or queues it while the node is not in its domain.
    pub(crate) fn publish(&self, message: M::Message) -> Result<(), SinkError> {
        let mut writer = lock(&self.writer);
        if self.delivery == Delivery::Latched {
            writer.newest = Some(message.clone());
        }
        let may_send = self.pulse.is_fresh();
        if writer.waiting.len() >= MAX_WAITING && !may_send {
            writer.dropped += 1;
            return Ok(());
        }
        writer.waiting.push_back(message);
        if may_send {
            writer.release(usize::MAX)?;
        }
        Ok(())
    }

    pub(crate) fn dropped(&self) -> u64 {
        lock(&self.writer).dropped
    }

    pub(crate) fn has_subscribers(&self) -> bool {
        self.others.subscribers.load(Ordering::Relaxed) > 0
    }
}

impl<M: Ros2Message> AnyTopic for Topic<M> {
    fn name(&self) -> &str {
        &self.name
    }

    fn is_exclusive(&self) -> bool {
        M::NAME == neuro_ros::NeuroFrame::NAME
    }

    fn others(&self) -> &Others {
        &self.others
    }

    fn reopen(&self, place: &mut Place) -> Result<(), Ros2Error> {
        let publisher = publisher::<M>(place, &self.name, self.delivery)?;
        let mut writer = lock(&self.writer);
        writer.publisher = publisher;
        writer.participant = place.participant.clone();
        match writer.newest.clone() {
            // If messages wait, the newest is among them and is published later.
            Some(newest) if writer.waiting.is_empty() => {
                writer.publish(newest).map_err(Ros2Error::network)
            }
            _ => Ok(()),
        }
    }

    fn release(&self, most: usize) -> Result<(), SinkError> {
        lock(&self.writer).release(most)
    }

    fn waiting(&self) -> usize {
        lock(&self.writer).waiting.len()
    }
}

impl<M: Ros2Message> Writer<M> {
    fn publish(&mut self, message: M::Message) -> Result<(), SinkError> {
        match self.publisher.publish(message) {
            Ok(()) => Ok(()),
            Err(WriteError::WouldBlock { .. }) => {
                self.dropped += 1;
                Ok(())
            }
            Err(error) => {
                self.dropped += 1;
                Err(io::Error::other(error.to_string()).into())
            }
        }
    }

    fn release(&mut self, most: usize) -> Result<(), SinkError> {
        for _ in 0..most.min(self.waiting.len()) {
            if let Some(message) = self.waiting.pop_front() {
                self.publish(message)?;
            }
        }
        Ok(())
    }
}

fn publisher<M: Ros2Message>(
    place: &mut Place,
    full_name: &str,
    delivery: Delivery,
) -> Result<Publisher<M::Message>, Ros2Error> {
    let of = MessageTypeName::new(M::PACKAGE, M::NAME);
    let topic = place.node.create_topic(&name(full_name)?, of, &delivery.qos())?;
    Ok(place.node.create_publisher(&topic, None)?)
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
