//! The node: its place in a DDS domain, its topics, and the thread that keeps both up to date.

use std::net::Ipv4Addr;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use neuro_ros::{AcquisitionCommand, AcquisitionInfo, DiagnosticLevel, DiagnosticStatus, KeyValue};
use ros2_client::names::NameError;
use ros2_client::{Context, Name, Node, NodeName, NodeOptions, Spinner};
use rustdds::{DomainParticipant, DomainParticipantBuilder, RTPSEntity as _};
use thiserror::Error;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::{oneshot, watch};
use tokio::time::sleep;

use crate::messages::Ros2Message;
use crate::services::{ServiceNames, Services};
use crate::sink::{Delivery, Ros2Sink};
use crate::topic::{AnyTopic, Pulse, Topic};

/// Time between two looks at who subscribes and publishes.
const GRAPH_PERIOD: Duration = Duration::from_millis(100);
/// Time for the last messages to be sent and acknowledged when a node with subscribers ends.
const LINGER: Duration = Duration::from_millis(300);
/// Longest wait for the subscribers of a node that joins its domain again.
const RETURN: Duration = Duration::from_secs(5);
/// Time for them to find the node, after the node has found them: longer than the period in which
/// DDS repeats what it says of itself, 1 s.
const SETTLE: Duration = Duration::from_secs(3);
/// Time between two attempts to join.
const RETRY: Duration = Duration::from_secs(1);
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
    pub(crate) fn network(error: impl std::fmt::Display) -> Ros2Error {
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

/// The node's place in its domain: what ends when it leaves.
pub(crate) struct Place {
    pub(crate) participant: DomainParticipant,
    pub(crate) node: Node,
}

/// What runs as long as the node is in its domain.
struct Life {
    spinner: Spinner,
    services: Services,
}

/// A ROS 2 node. It leaves the domain when it is dropped.
pub struct Ros2Node {
    shared: Arc<Shared>,
    thread: Option<Thread>,
}

struct Thread {
    stop: oneshot::Sender<()>,
    handle: JoinHandle<()>,
}

/// What the node shares with its thread.
struct Shared {
    full_name: String,
    name: NodeName,
    domain: Domain,
    services: ServiceNames,
    place: Mutex<Place>,
    topics: Mutex<Vec<Arc<dyn AnyTopic>>>,
    /// Announcement that the service `get_info` returns.
    announced: watch::Sender<Option<AcquisitionInfo>>,
    pulse: Arc<Pulse>,
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
        let name = NodeName::new(namespace, base).map_err(wrong)?;
        let announced = watch::Sender::new(None);
        let (place, life) = join(domain, &name, services, announced.subscribe())?;
        let pulse = Arc::<Pulse>::default();
        pulse.beat();
        let shared = Arc::new(Shared {
            full_name: full_name.to_owned(),
            name,
            domain,
            services: services.clone(),
            place: Mutex::new(place),
            topics: Mutex::default(),
            announced,
            pulse,
        });
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let continued = {
            let _in_runtime = runtime.enter();
            continued()?
        };
        let (stop, stopped) = oneshot::channel();
        let of_thread = Arc::clone(&shared);
        let run = move || {
            runtime.block_on(async {
                tokio::select! {
                    () = of_thread.run(life, continued, on_command) => {}
                    // An error says that the node was dropped.
                    _ = stopped => {}
                }
            });
        };
        let handle = std::thread::Builder::new().name("ros2".to_owned());
        let handle = handle.spawn(run)?;
        Ok(Ros2Node {
            shared,
            thread: Some(Thread { stop, handle }),
        })
    }

    /// Returns the node's full name, such as `/acquisition`.
    pub fn full_name(&self) -> &str {
        &self.shared.full_name
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
        let mut place = lock(&self.shared.place);
        let pulse = Arc::clone(&self.shared.pulse);
        let topic = Arc::new(Topic::create(&mut place, topic, delivery, pulse)?);
        lock(&self.shared.topics).push(topic.clone());
        Ok(Ros2Sink(topic))
    }

    /// Sets what the service `get_info` returns. `None` makes it return that nothing is known.
    pub fn announce(&self, info: Option<AcquisitionInfo>) {
        self.shared.announced.send_replace(info);
    }

    /// Returns the status for `/diagnostics`: the domain and who subscribes. Another publisher of a
    /// topic of frames is a warning.
    pub fn status(&self) -> DiagnosticStatus {
        let topics = lock(&self.shared.topics).clone();
        let shared = topics.iter().filter(|topic| {
            topic.is_exclusive() && topic.others().publishers.load(Ordering::Relaxed) > 0
        });
        let shared: Vec<&str> = shared.map(|topic| topic.name()).collect();
        let thread = self.thread.as_ref();
        let (level, message) = if thread.is_none_or(|thread| thread.handle.is_finished()) {
            let message = "the node's thread has ended, so its services do not answer and its \
                           messages wait; restart the bridge";
            (DiagnosticLevel::Error, message.to_owned())
        } else if !self.shared.pulse.is_fresh() {
            let message = "the node joins its domain again; its messages wait meanwhile";
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
            KeyValue::new("node", &self.shared.full_name),
            KeyValue::new("domain", &self.shared.domain.id),
            KeyValue::new("localhost only", &self.shared.domain.localhost_only),
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
        if self.shared.subscribers().iter().any(|count| *count > 0) {
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

impl Shared {
    /// Keeps the node in its domain, and never returns. The threads of rustdds end when the process
    /// is stopped and continued, because they take the interrupted wait for a failure. The node
    /// then joins its domain again, and its messages wait until its subscribers are back.
    async fn run(
        &self,
        mut life: Life,
        mut continued: Signal,
        on_command: impl Fn(AcquisitionCommand),
    ) {
        let mut expected = None;
        loop {
            tokio::select! {
                _ = life.spinner.spin() => {}
                () = life.services.serve(&on_command) => {}
                () = self.watch(expected, &mut continued) => {}
            }
            self.pulse.pause();
            let subscribers = self.subscribers();
            tracing::warn!(
                "the ROS 2 node joins its domain again, because the process stood still or DDS has ended; \
                 its messages wait until {} subscribers are back, for at most {} s",
                subscribers.iter().sum::<usize>(),
                RETURN.as_secs()
            );
            expected = Some(subscribers);
            life = loop {
                match self.join_again() {
                    Ok(life) => break life,
                    Err(error) => tracing::error!("the ROS 2 node is in no domain: {error}"),
                }
                sleep(RETRY).await;
            };
        }
    }

    fn join_again(&self) -> Result<Life, Ros2Error> {
        let announced = self.announced.subscribe();
        let (mut place, life) = join(self.domain, &self.name, &self.services, announced)?;
        let mut before = lock(&self.place);
        for topic in &*lock(&self.topics) {
            topic.reopen(&mut place)?;
        }
        *before = place;
        Ok(life)
    }

    /// Counts the subscribers and other publishers of the topics again and again. Messages wait
    /// until as many subscribers as `expected` are there. Returns when the node must join its
    /// domain again.
    async fn watch(&self, mut expected: Option<Vec<usize>>, continued: &mut Signal) {
        let participant = lock(&self.place).participant.clone();
        let until = Instant::now() + RETURN;
        loop {
            self.count(&participant);
            // Discovery has ended if it takes no command.
            if participant.assert_liveliness().is_err() {
                return;
            }
            let now = self.subscribers();
            let are_back = |then: &Vec<usize>| now.iter().zip(then).all(|(now, then)| now >= then);
            if expected
                .as_ref()
                .is_some_and(|then| are_back(then) || Instant::now() > until)
            {
                // The subscribers too have to find the node. Cyclone DDS takes the messages that a
                // new writer has when it first speaks for old ones, so one message goes ahead.
                sleep(SETTLE).await;
                self.release(1);
                sleep(GRAPH_PERIOD).await;
                expected = None;
            }
            if expected.is_none() {
                self.pulse.beat();
                self.release(usize::MAX);
            }
            tokio::select! {
                _ = continued.recv() => return,
                () = sleep(GRAPH_PERIOD) => {}
            }
            if expected.is_none() && !self.pulse.is_fresh() {
                // The process stood still, or had no processor: the signal can come later.
                tokio::select! {
                    _ = continued.recv() => return,
                    () = sleep(GRAPH_PERIOD) => {}
                }
            }
        }
    }

    /// Publishes the messages that wait, at most `most` of each topic.
    fn release(&self, most: usize) {
        for topic in lock(&self.topics).clone() {
            if let Err(error) = topic.release(most) {
                tracing::error!("messages of {} are lost: {error}", topic.name());
            }
        }
    }

    fn subscribers(&self) -> Vec<usize> {
        let topics = lock(&self.topics);
        let counts = topics.iter().map(|topic| &topic.others().subscribers);
        counts.map(|count| count.load(Ordering::Relaxed)).collect()
    }

    fn count(&self, participant: &DomainParticipant) {
        let own = participant.guid().prefix;
        let readers = participant.discovered_readers();
        let writers = participant.discovered_writers();
        for topic in &*lock(&self.topics) {
            let is = |name: &str| name.strip_prefix("rt") == Some(topic.name());
            let subscribers = readers.iter();
            let subscribers =
                subscribers.filter(|reader| is(reader.subscription_topic_data.topic_name()));
            let others = writers.iter().map(|writer| &writer.publication_topic_data);
            let others = others.filter(|writer| is(&writer.topic_name) && writer.key.prefix != own);
            let counts = topic.others();
            counts
                .subscribers
                .store(subscribers.count(), Ordering::Relaxed);
            counts.publishers.store(others.count(), Ordering::Relaxed);
        }
    }
}

/// Returns the signals that tell the process that it goes on after it was stopped.
fn continued() -> std::io::Result<Signal> {
    let sigcont = if cfg!(target_os = "linux") { 18 } else { 19 };
    signal(SignalKind::from_raw(sigcont))
}

/// Joins the domain, and creates the node and its services there.
fn join(
    domain: Domain,
    name: &NodeName,
    services: &ServiceNames,
    announced: watch::Receiver<Option<AcquisitionInfo>>,
) -> Result<(Place, Life), Ros2Error> {
    let participant = domain.join()?;
    let context = Context::from_domain_participant(participant.clone())?;
    // The log goes to /rosout by a sink, because ros2-client's own way logs each line again.
    let options = NodeOptions::new()
        .enable_rosout(false)
        .start_parameter_services(false);
    let node = context.new_node(name.clone(), options);
    let node = node.map_err(Ros2Error::network)?;
    let mut place = Place { participant, node };
    let services = Services::create(&mut place, services, announced)?;
    let spinner = place.node.spinner()?;
    Ok((place, Life { spinner, services }))
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
