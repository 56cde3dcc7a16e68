//! The bridge's ROS topics: which of them are published, and how many messages wait for each
//! subscriber.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use neuro_ros::ros1::{Node, NodeError, Publisher, PublisherOptions};
use neuro_ros::{
    DiagnosticLevel, KeyValue, NeuroFrame, RosMessage, RosSink, Sink, SinkError, Wire,
};

use crate::app::recorders::Recorders;
use crate::lock;

/// Interval at which the publishers of the topics are checked.
const CHECK_PERIOD: Duration = Duration::from_secs(1);

/// All topics of the bridge. A topic of frames is published only while no other node publishes it.
#[derive(Debug)]
pub(crate) struct RosTopics {
    node: Arc<Node>,
    frames: Mutex<Vec<Arc<FrameTopic>>>,
    /// Publishers of topics that other nodes may publish too, such as events.
    shared: Mutex<Vec<Publisher>>,
}

/// A topic of NeuroFrames, of which the bridge must be the only publisher.
#[derive(Debug)]
struct FrameTopic {
    /// Recorders to which each frame is reported, if any; `None` for all but the announced topic.
    recorders: Option<Arc<Recorders>>,
    /// Full name of the topic, after ROS's remapping.
    name: String,
    queue: usize,
    state: Mutex<TopicState>,
}

#[derive(Debug, Default)]
struct TopicState {
    claim: Claim,
    publisher: Option<Publisher>,
    /// Number of messages that earlier publishers of this topic, now withdrawn, have dropped.
    dropped: u64,
    /// Number of frames not published, because another node published the topic.
    withheld: u64,
}

impl RosTopics {
    pub(crate) fn new(node: Arc<Node>) -> RosTopics {
        RosTopics { node, frames: Mutex::default(), shared: Mutex::default() }
    }

    /// Adds a topic of frames with a queue of `queue` messages for each subscriber. If it is the
    /// announced topic, each published frame is reported to `recorders`. [`RosTopics::check`]
    /// advertises the topic later.
    pub(crate) fn frames(
        &self,
        name: &str,
        queue: usize,
        recorders: Option<Arc<Recorders>>,
    ) -> Result<FrameTopicSink, NodeError> {
        let name = self.node.resolve(name)?;
        let mut frames = lock(&self.frames);
        if frames.iter().any(|topic| topic.name == name) {
            return Err(NodeError::Duplicate(format!("publisher of {name}")));
        }
        let topic = Arc::new(FrameTopic { recorders, name, queue, state: Mutex::default() });
        frames.push(Arc::clone(&topic));
        let body = Vec::new();
        Ok(FrameTopicSink { topic, body })
    }

    /// Advertises a topic that other nodes may publish too.
    pub(crate) async fn shared<M: RosMessage>(
        &self,
        name: &str,
        queue: usize,
    ) -> Result<RosSink<M>, NodeError> {
        let sink = RosSink::advertise(&self.node, name, queue).await?;
        lock(&self.shared).push(sink.publisher().clone());
        Ok(sink)
    }

    /// Checks which nodes publish the topics of frames, at once and then every second in a task of
    /// its own.
    ///
    /// # Errors
    ///
    /// [`NodeError`] if a topic cannot be advertised. An absent ROS master is not an error.
    pub(crate) async fn start(self: &Arc<Self>) -> Result<(), NodeError> {
        self.check().await?;
        let topics = Arc::clone(self);
        tokio::spawn(async move {
            loop {
                tokio::time::sleep(CHECK_PERIOD).await;
                if let Err(error) = topics.check().await {
                    tracing::error!(%error, "a topic is not published");
                }
            }
        });
        Ok(())
    }

    /// Asks the ROS master who publishes the topics of frames. Advertises a topic that no other
    /// node publishes, and withdraws a topic that another node publishes. Checks again after
    /// advertising, because another node may have advertised it at the same time.
    async fn check(&self) -> Result<(), NodeError> {
        loop {
            // Without a master no node can subscribe, so the topics need not be advertised yet.
            let Ok(state) = self.node.system_state().await else {
                return Ok(());
            };
            let frames = lock(&self.frames).clone();
            let mut advertised = false;
            for topic in frames {
                let change = topic.observe(self.node.name(), state.publishers(&topic.name));
                if change == Change::Publish {
                    topic.advertise(&self.node).await?;
                    advertised = true;
                }
            }
            if !advertised {
                return Ok(());
            }
        }
    }

    /// Returns level and message for `/diagnostics` if one of the topics is not published because
    /// another node publishes it.
    pub(crate) fn objection(&self) -> Option<(DiagnosticLevel, String)> {
        let frames = lock(&self.frames);
        let objections: Vec<String> = frames.iter().filter_map(|t| t.objection()).collect();
        let message = objections.join("; ");
        (!message.is_empty()).then_some((DiagnosticLevel::Error, message))
    }

    /// Returns the numbers of messages waiting for each subscriber and of withheld frames, as
    /// values for `/diagnostics`.
    pub(crate) fn values(&self) -> Vec<KeyValue> {
        let mut values = Vec::new();
        let mut publishers = lock(&self.shared).clone();
        for topic in &*lock(&self.frames) {
            let state = lock(&topic.state);
            if state.withheld > 0 {
                let key = format!("frames withheld from {}", topic.name);
                values.push(KeyValue::new(&key, &state.withheld));
            }
            publishers.extend(state.publisher.clone());
        }
        for publisher in publishers {
            for lag in publisher.lags() {
                let key = format!("messages behind: {} on {}", lag.subscriber, publisher.topic());
                values.push(KeyValue::new(&key, &lag.waiting));
            }
        }
        values
    }
}

impl FrameTopic {
    /// Returns what the bridge must do with this topic, and stops publishing it if necessary. The
    /// ROS master lists the nodes `publishers` for the topic; `own` is the bridge's node.
    fn observe(&self, own: &str, publishers: &[String]) -> Change {
        let mut state = lock(&self.state);
        let before = state.claim.others().to_vec();
        let change = state.claim.check(own, publishers);
        if change == Change::Withdraw
            && let Some(publisher) = state.publisher.take()
        {
            state.dropped += publisher.dropped();
        }
        let others = state.claim.others();
        let is_new = change == Change::Withdraw || before != others;
        if !others.is_empty() && is_new && state.publisher.is_none() {
            tracing::error!(
                "{} is not published, because {} publishes it too, and a recorder cannot tell \
                 their frames apart; stop that node, remap one of the topics, or set --topic-prefix",
                self.name,
                others.join(" and ")
            );
        }
        change
    }

    async fn advertise(&self, node: &Node) -> Result<(), NodeError> {
        let options = PublisherOptions { queue: self.queue, latch: false };
        let advertised = node.advertise(&self.name, NeuroFrame::TYPE, options).await;
        let mut state = lock(&self.state);
        match advertised {
            Ok(publisher) => {
                if state.withheld > 0 {
                    tracing::info!("{} is published again", self.name);
                }
                state.publisher = Some(publisher);
                Ok(())
            }
            Err(error) => {
                state.claim.refused();
                Err(error)
            }
        }
    }

    fn objection(&self) -> Option<String> {
        let state = lock(&self.state);
        let withheld = state.publisher.is_none() && !state.claim.others().is_empty();
        withheld.then(|| {
            let others = state.claim.others().join(" and ");
            format!("{} is not published beside {others}", self.name)
        })
    }
}

/// Sink that publishes frames on a topic, or counts them as withheld if another node publishes it.
#[derive(Debug)]
pub(crate) struct FrameTopicSink {
    topic: Arc<FrameTopic>,
    /// Buffer for the encoded message, reused so that publishing needs no allocation.
    body: Vec<u8>,
}

impl Sink<NeuroFrame> for FrameTopicSink {
    fn publish(&mut self, frame: &NeuroFrame) -> Result<(), SinkError> {
        let mut state = lock(&self.topic.state);
        if let Some(publisher) = &state.publisher {
            self.body.clear();
            frame.write(&mut self.body);
            publisher.publish(&self.body);
            if let Some(recorders) = &self.topic.recorders {
                recorders.note_frame(frame);
            }
        } else if !state.claim.others().is_empty() {
            state.withheld += 1;
        }
        Ok(())
    }

    fn dropped(&self) -> u64 {
        let state = lock(&self.topic.state);
        state.dropped + state.publisher.as_ref().map_or(0, Publisher::dropped)
    }

    fn has_receivers(&self) -> bool {
        let state = lock(&self.topic.state);
        let publisher = state.publisher.as_ref();
        publisher.is_some_and(|publisher| publisher.subscribers() > 0)
    }
}

/// Number of checks in a row that must find no other publisher before the bridge publishes a topic
/// that another node has published. After a restart of the master, the other node registers again
/// within two checks, so the third one is reliable.
const FREE_CHECKS: u32 = 3;

/// The bridge's claim to be the only publisher of a topic. A recorder allocates memory for the
/// frames of one publisher, and would copy frames of another publisher into the same memory.
#[derive(Debug, Default)]
pub(crate) struct Claim {
    published: bool,
    /// Other nodes that published the topic at the last check.
    others: Vec<String>,
    /// Number of checks in a row that contradict the present state: checks that found another
    /// publisher while the bridge publishes, or checks that found none while it does not.
    checks: u32,
    /// Whether any check so far has found another publisher.
    contested: bool,
}

/// What the bridge must do with a topic after a check of its publishers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Keep,
    Publish,
    Withdraw,
}

impl Claim {
    /// Returns the other nodes that published the topic at the last check.
    pub(crate) fn others(&self) -> &[String] {
        &self.others
    }

    /// Decides what to do with the topic, whose `publishers` are in the order of their
    /// registration; `own` is the bridge's node.
    ///
    /// A bridge that registered first withdraws only at the second check in a row that finds
    /// another publisher. If the other publisher is a bridge too, that one registered later and
    /// withdraws at its first check. So one of the two keeps publishing.
    pub(crate) fn check(&mut self, own: &str, publishers: &[String]) -> Change {
        let others = publishers.iter().filter(|node| *node != own);
        self.others = others.cloned().collect();
        let is_free = self.others.is_empty();
        self.contested |= !is_free;
        let is_first = publishers.first().is_some_and(|node| node == own);
        self.checks = if is_free == self.published { 0 } else { self.checks + 1 };
        let change = match (self.published, is_free) {
            (true, false) if !is_first || self.checks > 1 => Change::Withdraw,
            (false, true) if !self.contested || self.checks >= FREE_CHECKS => Change::Publish,
            _ => return Change::Keep,
        };
        self.published = change == Change::Publish;
        self.checks = 0;
        change
    }

    /// Notes that advertising the topic has failed; the next check tries again.
    pub(crate) fn refused(&mut self) {
        self.published = false;
    }
}

#[cfg(test)]
mod tests {
    use super::{Change, Claim};

    fn nodes(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn a_topic_of_another_node_is_published_after_it_has_been_free_for_three_checks() {
        let mut claim = Claim::default();
        assert_eq!(claim.check("/us", &nodes(&["/filter"])), Change::Keep);
        assert_eq!(claim.others(), ["/filter"]);
        for change in [Change::Keep, Change::Keep, Change::Publish, Change::Keep] {
            assert_eq!(claim.check("/us", &[]), change);
        }
    }

    #[test]
    fn of_two_bridges_that_start_together_the_first_one_publishes() {
        let (mut first, mut second) = (Claim::default(), Claim::default());
        assert_eq!(first.check("/a", &[]), Change::Publish);
        assert_eq!(second.check("/b", &[]), Change::Publish);
        let both = nodes(&["/a", "/b"]);
        assert_eq!(first.check("/a", &both), Change::Keep);
        assert_eq!(second.check("/b", &both), Change::Withdraw);
        assert_eq!(first.check("/a", &nodes(&["/a"])), Change::Keep);
        assert_eq!(first.check("/a", &both), Change::Keep);
    }

    #[test]
    fn a_node_that_stays_beside_the_bridge_ends_its_publication() {
        let mut claim = Claim::default();
        let both = nodes(&["/us", "/filter"]);
        for (publishers, change) in [
            (&[][..], Change::Publish),
            (&both[..1], Change::Keep),
            (&both, Change::Keep),
            (&both, Change::Withdraw),
            (&both[1..], Change::Keep),
        ] {
            assert_eq!(claim.check("/us", publishers), change);
        }
    }
}
