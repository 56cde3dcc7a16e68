//! The node: its place in a DDS domain, its topics, and the thread that keeps both up to date.

use std::any::Any;
use std::net::Ipv4Addr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use neuro_ros::{AcquisitionCommand, AcquisitionInfo, DiagnosticLevel, DiagnosticStatus, KeyValue};
use ros2_client::names::NameError;
use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions};
use rustdds::{DomainParticipant, DomainParticipantBuilder, RTPSEntity as _};
use thiserror::Error;
use tokio::sync::{oneshot, watch};
use tokio::time::sleep;

use crate::messages::Ros2Message;
use crate::services::{ServiceNames, Services};
use crate::sink::{Delivery, Ros2Sink};

/// Time between two looks at who subscribes and publishes.
const GRAPH_PERIOD: Duration = Duration::from_millis(100);
/// Time for the last messages to be sent and acknowledged when a node with subscribers ends.
const LINGER: Duration = Duration::from_millis(300);
/// Largest id of a domain whose ports exist; see the port mapping of DDSI-RTPS.
pub(crate) const MAX_DOMAIN: u16 = 232;

/// Which nodes a node can meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Domain {
    /// Number of the domain, 0..=232, as in `ROS_DOMAIN_ID`.
    pub id: u16,
    /// Whether only nodes on this machine are met.
    pub localhost_only: bool,
}

impl Domain {
    fn join(self) -> Result<DomainParticipant, Ros2Error> {
        if self.id > MAX_DOMAIN {
            return Err(Ros2Error::Domain(self.id));
        }
        let mut participant = DomainParticipantBuilder::new(self.id);
        if self.localhost_only {
            participant = participant.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        participant.build().map_err(Ros2Error::network)
    }

    /// Joins the domain and leaves it again.
    ///
    /// # Errors
    ///
    /// [`Ros2Error`] if the domain does not exist, or the network cannot be used.
    pub fn check(self) -> Result<(), Ros2Error> {
        self.join().map(drop)
    }
}

/// Why a node cannot start, or a topic or service not be created.
#[derive(Debug, Error)]
pub enum Ros2Error {
    /// The name is not allowed in ROS 2.
    #[error(
        "{0} is no ROS 2 name ({1}): use letters, digits and single underscores between slashes"
    )]
    Name(String, String),
    /// The domain does not exist.
    #[error("there is no domain {0}; ROS_DOMAIN_ID is 0 to 232")]
    Domain(u16),
    /// The network cannot be used.
    #[error(
        "ROS 2 cannot use the network: {0}; choose another ROS_DOMAIN_ID, or bring an interface up"
    )]
    Network(String),
    /// No thread can be started.
    #[error("the thread of the ROS 2 node does not start: {0}")]
    Thread(#[from] std::io::Error),
}

impl Ros2Error {
    fn network(error: impl std::fmt::Display) -> Ros2Error {
        Ros2Error::Network(error.to_string())
    }
}

impl From<ros2_client::CreateError> for Ros2Error {
    fn from(error: ros2_client::CreateError) -> Ros2Error {
        Ros2Error::network(error)
    }
}

/// Parses the full name of a topic or service.
pub(crate) fn name(full: &str) -> Result<Name, Ros2Error> {
    let wrong = |error: NameError| Ros2Error::Name(full.to_owned(), error.to_string());
    Name::parse(full).map_err(wrong)
}

/// A topic of the node, with the newest counts of who else uses it.
pub(crate) struct Topic {
    /// Keeps the node in its domain until the last sink is gone, which says good-bye there.
    _participant: DomainParticipant,
    /// Keeps the writer, which sends lost packets again, until the node has lingered.
    _publisher: Arc<dyn Any + Send + Sync>,
    name: String,
    /// Whether no other node may publish this topic.
    is_exclusive: bool,
    subscribers: AtomicUsize,
    publishers: AtomicUsize,
}

impl Topic {
    pub(crate) fn has_subscribers(&self) -> bool {
        self.subscribers.load(Ordering::Relaxed) > 0
    }
}

/// A ROS 2 node. It leaves the domain when it is dropped.
pub struct Ros2Node {
    full_name: String,
    domain: Domain,
    participant: DomainParticipant,
    node: Mutex<Node>,
    topics: Arc<Mutex<Vec<Arc<Topic>>>>,
    /// Announcement that the service `get_info` returns.
    announced: watch::Sender<Option<AcquisitionInfo>>,
    thread: Option<Thread>,
}

struct Thread {
    stop: oneshot::Sender<()>,
    handle: JoinHandle<()>,
}

impl Ros2Node {
    /// Starts a node with the full name `full_name` and the services of an acquisition.
    /// `on_command` is called for each call of one of them, and must not wait.
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
        let node_name = NodeName::new(namespace, base).map_err(wrong)?;
        let participant = domain.join()?;
        let context = Context::from_domain_participant(participant.clone())?;
        // The log goes to /rosout by a sink, because ros2-client's own way logs each line again.
        let options = NodeOptions::new()
            .enable_rosout(false)
            .start_parameter_services(false);
        let node = context.new_node(node_name, options);
        let mut node = node.map_err(Ros2Error::network)?;
        let (announced, announcement) = watch::channel(None);
        let services = Services::create(&mut node, services, announcement)?;
        let spinner = node.spinner()?;
        let topics = Arc::<Mutex<Vec<Arc<Topic>>>>::default();
        let (stop, stopped) = oneshot::channel();
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build()?;
        let (watched, watching) = (Arc::clone(&topics), participant.clone());
        let run = move || {
            runtime.block_on(async {
                tokio::select! {
                    ended = spinner.spin() => tracing::error!(
                        "the ROS 2 node sees no other nodes any more: {ended:?}; restart the bridge"
                    ),
                    () = services.serve(on_command) => {}
                    () = watch_graph(&watching, &watched) => {}
                    // An error says that the node was dropped.
                    _ = stopped => {}
                }
            });
        };
        let handle = std::thread::Builder::new().name("ros2".to_owned());
        let handle = handle.spawn(run)?;
        Ok(Ros2Node {
            full_name: full_name.to_owned(),
            domain,
            participant,
            node: Mutex::new(node),
            topics,
            announced,
            thread: Some(Thread { stop, handle }),
        })
    }

    /// Returns the node's full name, such as `/acquisition`.
    pub fn full_name(&self) -> &str {
        &self.full_name
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
        let mut node = lock(&self.node);
        let of = MessageTypeName::new(M::PACKAGE, M::NAME);
        let created = node.create_topic(&name(topic)?, of, &delivery.qos())?;
        let publisher = Arc::new(node.create_publisher::<M::Message>(&created, None)?);
        let topic = Arc::new(Topic {
            _participant: self.participant.clone(),
            _publisher: publisher.clone(),
            name: topic.to_owned(),
            is_exclusive: M::NAME == neuro_ros::NeuroFrame::NAME,
            subscribers: AtomicUsize::new(0),
            publishers: AtomicUsize::new(0),
        });
        lock(&self.topics).push(Arc::clone(&topic));
        Ok(Ros2Sink::new(publisher, topic))
    }

    /// Sets what the service `get_info` returns. `None` makes it return that nothing is known.
    pub fn announce(&self, info: Option<AcquisitionInfo>) {
        self.announced.send_replace(info);
    }

    /// Returns the status for `/diagnostics`: the domain and who subscribes. Another publisher of a
    /// topic of frames is a warning.
    pub fn status(&self) -> DiagnosticStatus {
        let topics = lock(&self.topics).clone();
        let shared = topics
            .iter()
            .filter(|topic| topic.is_exclusive && topic.publishers.load(Ordering::Relaxed) > 0);
        let shared: Vec<&str> = shared.map(|topic| topic.name.as_str()).collect();
        let thread = self.thread.as_ref();
        let (level, message) = if thread.is_none_or(|thread| thread.handle.is_finished()) {
            let message =
                "the node's thread has ended and its services do not answer; restart the bridge";
            (DiagnosticLevel::Error, message.to_owned())
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
            let count = topic.subscribers.load(Ordering::Relaxed);
            KeyValue::new(&format!("subscribers of {}", topic.name), &count)
        });
        let values = [
            KeyValue::new("node", &self.full_name),
            KeyValue::new("domain", &self.domain.id),
            KeyValue::new("localhost only", &self.domain.localhost_only),
        ];
        DiagnosticStatus {
            level,
            name: "corticode: ros2".to_owned(),
            message,
            hardware_id: String::new(),
            values: values.into_iter().chain(subscribers).collect(),
        }
    }
}

impl Drop for Ros2Node {
    /// Waits [`LINGER`] if there are subscribers, then leaves the domain.
    fn drop(&mut self) {
        if lock(&self.topics)
            .iter()
            .any(|topic| topic.has_subscribers())
        {
            std::thread::sleep(LINGER);
        }
        if let Some(Thread { stop, handle }) = self.thread.take() {
            // Fails only if the thread has ended.
            let _ = stop.send(());
            if handle.join().is_err() {
                tracing::error!("the thread of the ROS 2 node has panicked");
            }
        }
    }
}

/// Counts the subscribers and other publishers of the topics again and again.
async fn watch_graph(participant: &DomainParticipant, topics: &Mutex<Vec<Arc<Topic>>>) {
    let own = participant.guid().prefix;
    loop {
        let readers = participant.discovered_readers();
        let writers = participant.discovered_writers();
        for topic in &*lock(topics) {
            let is = |name: &str| name.strip_prefix("rt") == Some(&topic.name);
            let subscribers = readers.iter();
            let subscribers =
                subscribers.filter(|reader| is(reader.subscription_topic_data.topic_name()));
            let others = writers.iter().map(|writer| &writer.publication_topic_data);
            let others = others.filter(|writer| is(&writer.topic_name) && writer.key.prefix != own);
            topic
                .subscribers
                .store(subscribers.count(), Ordering::Relaxed);
            topic.publishers.store(others.count(), Ordering::Relaxed);
        }
        sleep(GRAPH_PERIOD).await;
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
