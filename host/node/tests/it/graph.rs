//! A ROS graph: a master, the program, an acquisition and a subscriber to its codes.

use std::fs::{self, File};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use neuro_ros::ros1::xmlrpc::{Value, call_ros};
use neuro_ros::ros1::{Master, Node, NodeOptions, Publisher, PublisherOptions, Subscriber};
use neuro_ros::{DiagnosticArray, DiagnosticStatus, NeuroFrame, RosMessage, Stamp, Wire};
use tempfile::TempDir;
use tokio::time::{sleep, timeout};

use crate::acquisition::Acquisition;

/// Timeout of each wait, long enough for a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(30);

pub(crate) struct Graph {
    program: Child,
    log: TempDir,
    pub(crate) acquisition: Publisher,
    pub(crate) encoded: Subscriber,
    pub(crate) diagnostics: Subscriber,
    _node: Node,
    master: Master,
}

impl Graph {
    /// Starts the graph, and passes `options` to the program. Waits until the program receives the
    /// frames of the test, and the test receives the codes of the program.
    pub(crate) async fn start(options: &[&str]) -> Graph {
        let master = Master::start(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap();
        let node = node("test", master.uri()).await;
        let log = tempfile::tempdir().unwrap();
        let program = Command::new(env!("CARGO_BIN_EXE_corticode-node"))
            .args(["--ros-master-uri", master.uri()])
            .args(options)
            .env("ROS_HOSTNAME", "127.0.0.1")
            .env_remove("ROS_IP")
            .env_remove("RUST_LOG")
            // An environment variable with an empty value sets no option.
            .env("CORTICODE_MAINS", "")
            .stdin(Stdio::null())
            .stderr(File::create(log.path().join("log")).unwrap())
            .spawn()
            .unwrap();
        let graph = Graph {
            program,
            log,
            acquisition: publisher(&node).await,
            encoded: node.subscribe("/encoded", NeuroFrame::TYPE, 1024).await.unwrap(),
            diagnostics: node.subscribe("/diagnostics", DiagnosticArray::TYPE, 64).await.unwrap(),
            _node: node,
            master,
        };
        let connected = || graph.acquisition.subscribers() > 0 && graph.encoded.publishers() > 0;
        graph.until("connected", connected).await;
        graph
    }

    pub(crate) async fn until(&self, what: &str, holds: impl Fn() -> bool) {
        let deadline = Instant::now() + TIMEOUT;
        while !holds() {
            assert!(Instant::now() < deadline, "not {what}: {}", self.log());
            sleep(Duration::from_millis(20)).await;
        }
    }

    /// Returns another node, and its publisher of frames on the same topic.
    pub(crate) async fn another_acquisition(&self) -> (Node, Publisher) {
        let node = node("other", self.master.uri()).await;
        let publisher = publisher(&node).await;
        (node, publisher)
    }

    /// Calls a method of the ROS master as the node `/other`.
    pub(crate) async fn call_master(&self, method: &str, arguments: &[&str]) {
        let caller = ["/other"].iter().chain(arguments);
        let arguments: Vec<Value> = caller.map(|text| Value::from(*text)).collect();
        call_ros(self.master.uri(), method, &arguments).await.unwrap();
    }

    /// Publishes frames with these numbers, at the pace of a real acquisition.
    pub(crate) async fn publish(&self, numbers: impl IntoIterator<Item = u32>) {
        for number in numbers {
            self.acquisition.publish(&frame(number).to_bytes());
            sleep(Duration::from_micros(62_500)).await;
        }
    }

    /// Waits for a report in which the status `name` is as expected, and returns this status.
    pub(crate) async fn status(
        &mut self,
        name: &str,
        is_expected: impl Fn(&DiagnosticStatus) -> bool,
    ) -> DiagnosticStatus {
        let deadline = Instant::now() + TIMEOUT;
        loop {
            let report = timeout(TIMEOUT, self.diagnostics.recv()).await.unwrap().unwrap();
            let report = DiagnosticArray::from_bytes(&report).unwrap();
            let mut statuses = report.status.into_iter();
            let status = statuses.find(|status| status.name == name).unwrap();
            if is_expected(&status) {
                return status;
            }
            assert!(Instant::now() < deadline, "{status:?}: {}", self.log());
        }
    }

    pub(crate) async fn next_code(&mut self) -> NeuroFrame {
        let body = timeout(TIMEOUT, self.encoded.recv()).await;
        let body = body.unwrap_or_else(|_| panic!("no code: {}", self.log()));
        NeuroFrame::from_bytes(&body.unwrap()).unwrap()
    }

    pub(crate) fn log(&self) -> String {
        fs::read_to_string(self.log.path().join("log")).unwrap()
    }
}

impl Drop for Graph {
    fn drop(&mut self) {
        // Killing fails if the program has ended already.
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

async fn node(name: &str, uri: &str) -> Node {
    let options = NodeOptions { host: Some("127.0.0.1".to_owned()), ..NodeOptions::new(name, uri) };
    Node::start(options).await.unwrap()
}

async fn publisher(node: &Node) -> Publisher {
    let options = PublisherOptions { queue: 1024, latch: false };
    node.advertise("/neurodata", NeuroFrame::TYPE, options).await.unwrap()
}

/// Returns frame `number` of an acquisition with the model's electrodes: it lasts 62.5 ms and is
/// stamped with the present time.
pub(crate) fn frame(number: u32) -> NeuroFrame {
    let mut frame = Acquisition::new(model::ADC_RATE_HZ, model::ADC_RATE_HZ / 16).frame(number - 1);
    frame.header.stamp = Stamp::now();
    frame
}
