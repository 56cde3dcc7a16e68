//! The public interface of the node: topics, announcement and status.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::Duration;

use neuro_ros::{AcquisitionCommand, AcquisitionInfo, DiagnosticLevel, DiagnosticStatus, KeyValue};
use ros2_client::NodeName;
use ros2_client::names::NameError;
use tokio::sync::oneshot;

use crate::domain::{Domain, Ros2Error};
use crate::messages::Ros2Message;
use crate::presence::{Presence, continued};
use crate::services::ServiceNames;
use crate::sink::{Delivery, Ros2Sink};
use crate::topic::{Topic, lock};

/// Time for the last messages and replies to be sent and acknowledged when a node ends.
const LINGER: Duration = Duration::from_millis(300);

/// A ROS 2 node. It leaves the domain when it is dropped.
pub struct Ros2Node {
    presence: Arc<Presence>,
    thread: Option<Thread>,
}

struct Thread {
    stop: oneshot::Sender<()>,
    handle: JoinHandle<()>,
}

impl Ros2Node {
    /// Starts a node with the full name `full_name` and the services of an acquisition.
    /// `on_command` is called for each call of start, stop or quit, and must not wait.
    ///
    /// # Errors
    ///
    /// [`Ros2Error`] if a name is wrong, or the network cannot be used.
    pub fn start(
        full_name: &str,
        domain: Domain,
        services: &ServiceNames,
        on_command: impl Fn(AcquisitionCommand) + Send + 'static,
    ) -> Result<Ros2Node, Ros2Error> {
        let (namespace, base) = full_name.rsplit_once('/').unwrap_or(("", full_name));
        let namespace = if namespace.is_empty() { "/" } else { namespace };
        let wrong = |error: NameError| Ros2Error::Name(full_name.to_owned(), error.to_string());
        let name = NodeName::new(namespace, base).map_err(wrong)?;
        let (presence, life) = Presence::start(full_name, name, domain, services)?;
        let presence = Arc::new(presence);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let continued = {
            let _in_runtime = runtime.enter();
            continued()?
        };
        let (stop, stopped) = oneshot::channel();
        let of_thread = Arc::clone(&presence);
        let run = move || {
            runtime.block_on(async {
                tokio::select! {
                    () = of_thread.run(life, continued, on_command) => {}
                    // An error means that the node was dropped.
                    _ = stopped => {}
                }
            });
        };
        let handle = std::thread::Builder::new().name("ros2".to_owned());
        let handle = handle.spawn(run)?;
        Ok(Ros2Node { presence, thread: Some(Thread { stop, handle }) })
    }

    /// Returns the node's full name, such as `/acquisition`.
    pub fn full_name(&self) -> &str {
        &self.presence.full_name
    }

    /// Creates a sink for the topic with the full name `topic`.
    ///
    /// # Errors
    ///
    /// [`Ros2Error`] if the name is wrong, or the topic cannot be created.
    pub fn sink<M: Ros2Message>(
        &self,
        topic: &str,
        delivery: Delivery,
    ) -> Result<Ros2Sink<M>, Ros2Error> {
        let mut place = lock(&self.presence.place);
        let pulse = Arc::clone(&self.presence.pulse);
        let topic = Arc::new(Topic::create(&mut place, topic, delivery, pulse)?);
        lock(&self.presence.topics).push(topic.clone());
        Ok(Ros2Sink(topic))
    }

    /// Sets what the service `get_info` returns. With `None`, its reply has the `result` false.
    pub fn announce(&self, info: Option<AcquisitionInfo>) {
        self.presence.announced.send_replace(info);
    }

    /// Returns the number of messages that wait for the node to join its domain again. They are
    /// lost if the node ends now.
    pub fn waiting(&self) -> u64 {
        self.presence.waiting() as u64
    }

    /// Returns the status for `/diagnostics`: the domain, and the number of subscribers of each
    /// topic. It is a warning if another node publishes on a topic of frames.
    pub fn status(&self) -> DiagnosticStatus {
        let topics = lock(&self.presence.topics).clone();
        let shared = topics.iter().filter(|topic| {
            topic.is_exclusive() && topic.others().publishers.load(Ordering::Relaxed) > 0
        });
        let shared: Vec<&str> = shared.map(|topic| topic.name()).collect();
        let thread = self.thread.as_ref();
        let (level, message) = if thread.is_none_or(|thread| thread.handle.is_finished()) {
            let message = "the node's thread has ended, so its services do not answer and its \
                           messages wait; restart the bridge";
            (DiagnosticLevel::Error, message.to_owned())
        } else if !self.presence.pulse.is_fresh() {
            let message = "the node joins its domain again, or its process stood still; its \
                           messages wait meanwhile";
            (DiagnosticLevel::Warn, message.to_owned())
        } else if shared.is_empty() {
            (DiagnosticLevel::Ok, "the node is in its domain".to_owned())
        } else {
            let message = format!(
                "another node publishes {} too, and a recorder cannot tell their frames apart; stop that node, or \
                 remap one of the topics",
                shared.join(" and ")
            );
            (DiagnosticLevel::Warn, message)
        };
        let subscribers = topics.iter().map(|topic| {
            let count = topic.others().subscribers.load(Ordering::Relaxed);
            KeyValue::new(&format!("subscribers of {}", topic.name()), &count)
        });
        let values = [
            KeyValue::new("node", &self.presence.full_name),
            KeyValue::new("domain", &self.presence.domain.id),
            KeyValue::new("localhost only", &self.presence.domain.localhost_only),
        ];
        let values = values.into_iter().chain(subscribers).collect();
        DiagnosticStatus::new("ros2", (level, message), values)
    }
}

impl Drop for Ros2Node {
    /// Waits 0.3 s, so that the last messages arrive, then leaves the domain.
    fn drop(&mut self) {
        std::thread::sleep(LINGER);
        if let Some(Thread { stop, handle }) = self.thread.take() {
            // Fails only if the thread has ended.
            let _ = stop.send(());
            if handle.join().is_err() {
                tracing::error!("the thread of the ROS 2 node has panicked");
            }
        }
        for topic in &*lock(&self.presence.topics) {
            let waiting = topic.waiting();
            if waiting > 0 {
                tracing::warn!(
                    "{waiting} messages of {} are lost in ROS 2: the node was not in its domain again",
                    topic.name()
                );
            }
        }
    }
}
