//! The programs, connections and subscribers of a run.

use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use neuro_ros::{NeuroFrame, RosMessage};
use ros1::{Master, Node, NodeOptions, Publisher, PublisherOptions};
use tempfile::TempDir;
use tokio::time::sleep;

use super::amplifier::{Amplifier, FIRST};
use crate::report::bridge::node_figures::Figures;
use crate::report::bridge::rospy::{Rospy, code_arguments};
use crate::report::bridge::setup::{Programs, Running};
use crate::report::bridge::subscriber::Subscriber;
use crate::report::bridge::usage::Usage;
use crate::report::{checked_in, python_model};

/// Program that is measured.
pub(super) const NODE: &str = "corticode-node";
/// Topics of `corticode-node` and of the node in rospy: frames and codes.
const TOPICS: [[&str; 2]; 2] = [
    ["/neurodata", "/encoded"],
    ["/rospy/neurodata", "/rospy/encoded"],
];
/// Longest time until the first code arrives, on a busy machine.
const START: Duration = Duration::from_secs(30);
/// Time that is not measured: connections are new, and caches are cold.
const WARM_UP: Duration = Duration::from_secs(3);
/// Time after the measurement in which its last codes arrive.
const STRAGGLERS: Duration = Duration::from_secs(1);

/// Figures of both nodes over the same time.
#[derive(Debug)]
pub(super) struct Pair {
    pub(super) node: Figures,
    /// `None` where rospy is not installed.
    pub(super) rospy: Option<Figures>,
    /// Whether the node in rospy encodes: PyTorch is installed.
    pub(super) rospy_encodes: bool,
}

/// Both nodes with their acquisition, a ROS master, and a subscriber of each.
#[derive(Debug)]
pub(super) struct Setup {
    node: Running,
    rospy: Option<Running>,
    rospy_encodes: bool,
    amplifier: Amplifier,
    codes: [Subscriber; 2],
    _node: Node,
    _master: Master,
    _folder: TempDir,
}

impl Setup {
    /// Starts everything and waits until codes arrive.
    ///
    /// # Errors
    /// A program does not start, or no code comes.
    pub(super) async fn start(programs: &Programs) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir()?;
        let any_port = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let master = Master::start(any_port).await?;
        let own = Node::start(NodeOptions {
            host: Some("127.0.0.1".to_owned()),
            ..NodeOptions::new("bench", master.uri())
        });
        let own = own.await?;
        let codes = [
            Subscriber::start(&own, TOPICS[0][1]).await?,
            Subscriber::start(&own, TOPICS[1][1]).await?,
        ];
        let publishers = [
            advertise(&own, TOPICS[0][0]).await?,
            advertise(&own, TOPICS[1][0]).await?,
        ];
        let node = programs.start(NODE, folder.path(), |node| {
            node.args(["--ros-master-uri", master.uri()])
                .env("ROS_HOSTNAME", "127.0.0.1")
                .env_remove("ROS_IP")
        })?;
        let first = FIRST.to_string();
        let [length, rate] = code_arguments();
        let mut arguments = vec![TOPICS[1][0], TOPICS[1][1], &first, &length, &rate];
        let model = python_model::request(&checked_in::artifact()?.description).to_string();
        let torch = Rospy::find_with_torch();
        if torch.is_some() {
            arguments.push(&model);
        }
        let rospy = torch.or_else(Rospy::find);
        let rospy = rospy.map(|rospy| {
            rospy.start_script("rospy_node.py", &arguments, master.uri(), folder.path())
        });
        let rospy = rospy.transpose()?.map(Running);
        let mut expected = vec![&publishers[0]];
        expected.extend(rospy.as_ref().map(|_| &publishers[1]));
        wait_for_subscribers(&expected).await?;
        let amplifier = Amplifier::start(publishers);
        codes[0].wait_for_code(START).await?;
        if rospy.is_some() {
            codes[1].wait_for_code(START).await?;
        }
        Ok(Self {
            node,
            rospy,
            rospy_encodes: torch.is_some(),
            amplifier,
            codes,
            _node: own,
            _master: master,
            _folder: folder,
        })
    }

    /// Measures both nodes for `seconds`.
    ///
    /// # Errors
    /// A node has ended.
    pub(super) async fn measure(&self, seconds: u32) -> anyhow::Result<Pair> {
        sleep(WARM_UP).await;
        let before = self.usage()?;
        let start = Instant::now();
        sleep(Duration::from_secs(seconds.into())).await;
        let span = [start, Instant::now()];
        let after = self.usage()?;
        sleep(STRAGGLERS).await;
        let sent = self.amplifier.times();
        let figures = |place: usize| {
            let usage = after[place]?.since(&before[place]?);
            let arrived = self.codes[place].times();
            Some(Figures::new(&sent[place], &arrived, span, &usage))
        };
        Ok(Pair {
            node: figures(0).context("corticode-node has ended")?,
            rospy: figures(1),
            rospy_encodes: self.rospy_encodes,
        })
    }

    /// Returns the usage of both nodes.
    fn usage(&self) -> anyhow::Result<[Option<Usage>; 2]> {
        let rospy = self.rospy.as_ref().map(|rospy| Usage::of(rospy.0.id()));
        Ok([Some(Usage::of(self.node.0.id())?), rospy.transpose()?])
    }
}

async fn advertise(node: &Node, topic: &str) -> anyhow::Result<Publisher> {
    let options = PublisherOptions {
        queue: 64,
        latch: false,
    };
    Ok(node.advertise(topic, NeuroFrame::TYPE, options).await?)
}

async fn wait_for_subscribers(publishers: &[&Publisher]) -> anyhow::Result<()> {
    let deadline = Instant::now() + START;
    while publishers
        .iter()
        .any(|publisher| publisher.subscribers() == 0)
    {
        ensure!(
            Instant::now() < deadline,
            "a node does not subscribe within {} s\n  next: is the machine very busy? repeat",
            START.as_secs()
        );
        sleep(Duration::from_millis(20)).await;
    }
    Ok(())
}
