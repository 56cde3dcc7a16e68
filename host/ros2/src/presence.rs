//! The node in its domain, and the thread that keeps it there.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use neuro_ros::{AcquisitionCommand, AcquisitionInfo};
use ros2_client::{Context, Node, NodeName, NodeOptions, Spinner};
use rustdds::{DomainParticipant, RTPSEntity as _};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::watch;
use tokio::time::sleep;

use crate::domain::{Domain, Ros2Error};
use crate::services::{ServiceNames, Services};
use crate::topic::{AnyTopic, Pulse, lock};

/// Time between two counts of the subscribers and publishers.
const GRAPH_PERIOD: Duration = Duration::from_millis(100);
/// Time limit for the subscribers to return after the node has joined its domain again.
const RETURN: Duration = Duration::from_secs(5);
/// Time for the subscribers to find the node after the node has found them. It is longer than the
/// period of DDS announcements, 1 s.
const SETTLE: Duration = Duration::from_secs(3);
/// Time between two attempts to join.
const RETRY: Duration = Duration::from_secs(1);

/// The node's objects in its domain, which end when it leaves the domain.
pub(crate) struct Place {
    pub(crate) participant: DomainParticipant,
    pub(crate) node: Node,
}

/// The tasks that run as long as the node is in its domain.
pub(crate) struct Life {
    spinner: Spinner,
    services: Services,
}

/// A node that joins its domain again whenever DDS has ended there.
pub(crate) struct Presence {
    pub(crate) full_name: String,
    name: NodeName,
    pub(crate) domain: Domain,
    services: ServiceNames,
    pub(crate) place: Mutex<Place>,
    pub(crate) topics: Mutex<Vec<Arc<dyn AnyTopic>>>,
    /// Announcement that the service `get_info` returns.
    pub(crate) announced: watch::Sender<Option<AcquisitionInfo>>,
    pub(crate) pulse: Arc<Pulse>,
}

impl Presence {
    pub(crate) fn start(
        full_name: &str,
        name: NodeName,
        domain: Domain,
        services: &ServiceNames,
    ) -> Result<(Presence, Life), Ros2Error> {
        let announced = watch::Sender::new(None);
        let (place, life) = join(domain, &name, services, announced.subscribe())?;
        let pulse = Arc::<Pulse>::default();
        pulse.beat();
        let presence = Presence {
            full_name: full_name.to_owned(),
            name,
            domain,
            services: services.clone(),
            place: Mutex::new(place),
            topics: Mutex::default(),
            announced,
            pulse,
        };
        Ok((presence, life))
    }

    /// Keeps the node in its domain, and never returns. The threads of rustdds end when the process
    /// is stopped and continued, because they mistake the interrupted wait for a failure. The node
    /// then joins its domain again, and its messages wait until its subscribers are back.
    pub(crate) async fn run(
        &self,
        mut life: Life,
        mut continued: Signal,
        on_command: impl Fn(AcquisitionCommand),
    ) {
        let mut expected = None::<Vec<usize>>;
        loop {
            let joined = Instant::now();
            tokio::select! {
                _ = life.spinner.spin() => {}
                () = life.services.serve(&on_command) => {}
                () = self.watch(&mut expected, &mut continued) => {}
            }
            self.pulse.pause();
            let expected = expected.get_or_insert_with(|| self.subscribers());
            tracing::warn!(
                "the ROS 2 node joins its domain again, because the process stood still or DDS has ended; \
                 its messages wait until {} subscribers are back, for at most {} s",
                expected.iter().sum::<usize>(),
                (RETURN + SETTLE).as_secs()
            );
            sleep(RETRY.saturating_sub(joined.elapsed())).await;
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

    /// Counts the subscribers and other publishers of each topic every 100 ms. Messages wait until
    /// there are as many subscribers as `expected`, but no longer than [`RETURN`], and then for
    /// another [`SETTLE`]. Returns when the node must join its domain again.
    async fn watch(&self, expected: &mut Option<Vec<usize>>, continued: &mut Signal) {
        let participant = lock(&self.place).participant.clone();
        let until = Instant::now() + RETURN;
        loop {
            self.count(&participant);
            // An error means that the discovery thread of DDS has ended.
            if participant.assert_liveliness().is_err() {
                return;
            }
            if let Some(then) = expected.as_deref()
                && (self.missing(then) == 0 || Instant::now() > until)
            {
                // The subscribers must also find the node. Cyclone DDS regards the messages that a
                // new writer announces first as old ones, so send one message ahead of the others.
                for (wait, most) in [(SETTLE, 1), (GRAPH_PERIOD, usize::MAX)] {
                    sleep(wait).await;
                    self.count(&participant);
                    // DDS can have ended again meanwhile.
                    if participant.assert_liveliness().is_err() {
                        return;
                    }
                    if most > 1 {
                        self.report_return(then);
                    }
                    self.release(most);
                }
                *expected = None;
            }
            if expected.is_none() {
                self.pulse.beat();
                self.release(usize::MAX);
            }
            let was_continued = tokio::select! {
                _ = continued.recv() => true,
                () = sleep(GRAPH_PERIOD) => false,
            };
            if !was_continued && self.pulse.is_fresh() {
                continue;
            }
            // Join again only after SIGCONT and a stale pulse. Either can come alone: a stale pulse
            // from a busy processor, SIGCONT after a stop too short to end DDS or from systemd.
            let stood_still = !self.pulse.is_fresh();
            self.pulse.pause();
            let was_continued = tokio::select! {
                _ = continued.recv() => true,
                () = sleep(GRAPH_PERIOD) => was_continued,
            };
            if was_continued && stood_still && expected.is_none() {
                return;
            }
        }
    }

    /// Returns how many subscribers are missing in comparison with the earlier numbers `then`.
    fn missing(&self, then: &[usize]) -> usize {
        let now = self.subscribers();
        let missing = then.iter().zip(now).map(|(then, now)| then.saturating_sub(now));
        missing.sum()
    }

    /// Logs that the waiting messages are published now, and how many subscribers are missing.
    fn report_return(&self, then: &[usize]) {
        let waiting = self.waiting();
        match self.missing(then) {
            0 => tracing::info!(
                "the ROS 2 node is in its domain again, and sends {waiting} messages that have waited"
            ),
            missing => tracing::warn!(
                "the ROS 2 node is in its domain again, but {missing} subscribers are not back: they miss \
                 {waiting} messages"
            ),
        }
    }

    /// Returns the number of messages that wait for the node to be in its domain again.
    pub(crate) fn waiting(&self) -> usize {
        lock(&self.topics).iter().map(|topic| topic.waiting()).sum()
    }

    /// Publishes the messages that wait, at most `most` of each topic.
    fn release(&self, most: usize) {
        for topic in lock(&self.topics).clone() {
            if let Err(error) = topic.release(most) {
                tracing::error!("messages of {} are lost: {error}", topic.name());
            }
        }
    }

    pub(crate) fn subscribers(&self) -> Vec<usize> {
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
            counts.subscribers.store(subscribers.count(), Ordering::Relaxed);
            counts.publishers.store(others.count(), Ordering::Relaxed);
        }
    }
}

/// Returns the stream of SIGCONT signals, which the process receives when it continues.
pub(crate) fn continued() -> std::io::Result<Signal> {
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
    // Keep ros2-client off /rosout: a sink publishes the log there, and ros2-client would log each
    // message again.
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    let node = context.new_node(name.clone(), options);
    let node = node.map_err(Ros2Error::network)?;
    let mut place = Place { participant, node };
    let services = Services::create(&mut place, services, announced)?;
    let spinner = place.node.spinner()?;
    Ok((place, Life { spinner, services }))
}
