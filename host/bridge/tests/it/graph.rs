//! The bridge as a node in a ROS graph.

use std::net::SocketAddr;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use link::ToDevice;
use neuro_ros::ros1::xmlrpc::{Value, call_ros};
use neuro_ros::ros1::{Master, Node, NodeOptions, PublisherOptions, Subscriber};
use neuro_ros::{
    AcquisitionInfo, DiagnosticArray, EMPTY, GET_ACQUISITION_INFO, GET_INFO_SERVICE, NeuroFrame,
    RosMessage, UInt8, Wire,
};
use rustix::process::Signal;
use tokio::time::{sleep, timeout};

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::process::{Bridge, TIMEOUT};

/// A ROS master, a board on a TCP port, and the node `recorder`.
pub(crate) struct Graph {
    pub(crate) master: Master,
    pub(crate) device: Device,
    pub(crate) node: Node,
}

impl Graph {
    pub(crate) async fn new() -> Graph {
        let master = master().await;
        let node = node("recorder", master.uri()).await;
        let device = Device::tcp(Board::new());
        Graph { master, device, node }
    }

    /// Starts a bridge between the board and the master, with `more` arguments added.
    pub(crate) fn bridge_with(&self, more: &[&str]) -> Bridge {
        let (port, uri) = (&*self.device.port, self.master.uri());
        let arguments = ["--port", port, "--ros-master-uri", uri];
        Bridge::start(&[&arguments[..], more].concat())
    }

    pub(crate) fn bridge(&self) -> Bridge {
        self.bridge_with(&[])
    }

    /// Subscribes the node `recorder` to a topic of frames.
    pub(crate) async fn subscribe(&self, topic: &str) -> Subscriber {
        subscribe(&self.node, topic).await
    }
}

pub(crate) async fn master() -> Master {
    Master::start(SocketAddr::from(([127, 0, 0, 1], 0))).await.unwrap()
}

pub(crate) async fn node(name: &str, uri: &str) -> Node {
    let options = NodeOptions { host: Some("127.0.0.1".to_owned()), ..NodeOptions::new(name, uri) };
    Node::start(options).await.unwrap()
}

pub(crate) async fn frame(subscriber: &mut Subscriber) -> NeuroFrame {
    let body = timeout(TIMEOUT, subscriber.recv()).await;
    let body = body.expect("no frame came").unwrap();
    NeuroFrame::from_bytes(&body).unwrap()
}

/// Subscribes `node` to a topic of frames.
pub(crate) async fn subscribe(node: &Node, topic: &str) -> Subscriber {
    let subscriber = node.subscribe(topic, NeuroFrame::TYPE, 1024).await;
    subscriber.unwrap()
}

/// Waits until a bridge exits by itself with status 0. Returns its log.
pub(crate) async fn ended(bridge: Bridge) -> String {
    let ended = tokio::task::spawn_blocking(|| bridge.success()).await;
    ended.unwrap()
}

pub(crate) async fn until(what: &str, mut holds: impl AsyncFnMut() -> bool) {
    let deadline = Instant::now() + TIMEOUT;
    while !holds().await {
        assert!(Instant::now() < deadline, "{what}: not within {TIMEOUT:?}");
        sleep(Duration::from_millis(20)).await;
    }
}

/// Returns whether the ROS master at `uri` knows the bridge's service `get_info`.
pub(crate) async fn registered(uri: &str) -> bool {
    let arguments = ["/test", "/acquisition/get_info"].map(|text| Value::String(text.to_owned()));
    call_ros(uri, "lookupService", &arguments).await.is_ok()
}

/// Calls the service `get_info` until it answers, as rosneuro_recorder does.
pub(crate) async fn announcement(node: &Node, get_info: &str) -> AcquisitionInfo {
    let deadline = Instant::now() + TIMEOUT;
    loop {
        match node.call(get_info, &GET_ACQUISITION_INFO, &[]).await {
            Ok(answer) => {
                let info = AcquisitionInfo::from_response(&answer).unwrap();
                return info.expect("a result").unwrap();
            }
            Err(error) => assert!(Instant::now() < deadline, "{get_info}: {error}"),
        }
        sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn codes_reach_a_subscriber_and_match_the_announcement() {
    let graph = Graph::new().await;
    let (bridge, device, node) = (graph.bridge(), &graph.device, &graph.node);
    let mut encoded = graph.subscribe("/encoded").await;
    let mut reconstructed = graph.subscribe("/neurodata_reconstructed").await;
    let type_ = DiagnosticArray::TYPE;
    let mut diagnostics = node.subscribe("/diagnostics", type_, 8).await.unwrap();
    let info = announcement(node, GET_INFO_SERVICE).await;
    let mut next = frame(&mut encoded).await.neuroheader.seq;
    for _ in 0..20 {
        let frame = frame(&mut encoded).await;
        next += 1;
        assert_eq!((frame.neuroheader.seq, frame.header.seq), (next, next));
        info.shape().admit(&frame).unwrap();
        assert_eq!(frame.eeg.info, info.frame().eeg.info);
    }
    let frame = frame(&mut reconstructed).await;
    assert_eq!((frame.sr, frame.eeg.info.nsamples), (128, 8));
    assert_eq!(frame.eeg.data.len(), 8 * 61);
    let report = timeout(TIMEOUT, diagnostics.recv()).await.unwrap().unwrap();
    let report = DiagnosticArray::from_bytes(&report).unwrap();
    let names: Vec<&str> = report.status.iter().map(|status| &*status.name).collect();
    let parts = ["device", "loss", "link", "clock", "outlets"];
    assert_eq!(names[..5], parts.map(|part| format!("corticode: {part}")));

    node.call("/acquisition/stop", &EMPTY, &[]).await.unwrap();
    until("Stop", async || device.received().last() == Some(&ToDevice::Stop)).await;
    node.call("/acquisition/start", &EMPTY, &[]).await.unwrap();
    until("Start", async || matches!(device.received().last(), Some(ToDevice::Start(_)))).await;
    node.call("/acquisition/quit", &EMPTY, &[]).await.unwrap();
    let log = ended(bridge).await;
    assert!(log.contains("lost 0 "), "{log}");
    assert_eq!(device.received().last(), Some(&ToDevice::Stop));
    let is_registered = registered(graph.master.uri()).await;
    assert!(!is_registered, "the bridge did not unregister");
}

#[tokio::test]
async fn the_bridge_registers_with_a_late_master_and_again_after_its_restart() {
    let first = master().await;
    let uri = first.uri().to_owned();
    let address: SocketAddr =
        uri.trim_start_matches("http://").trim_end_matches('/').parse().unwrap();
    first.shutdown().await;
    let device = Device::tcp(Board::new());
    let bridge = Bridge::start(&["--port", &device.port, "--ros-master-uri", &uri]);
    until("codes", async || device.controls.made.load(Relaxed) > 5).await;
    // Wait until the bridge has logged that there is no ROS master, which takes it 1 s.
    sleep(Duration::from_millis(1500)).await;
    for round in 0..2 {
        let master = Master::start(address).await.unwrap();
        let began = Instant::now();
        until("registration", async || registered(&uri).await).await;
        println!("registered after {:?}", began.elapsed());
        let node = node("listener", &uri).await;
        let mut encoded = subscribe(&node, "/encoded").await;
        let seq = frame(&mut encoded).await.neuroheader.seq;
        assert!(seq > 5, "round {round}: {seq}");
        node.shutdown().await;
        master.shutdown().await;
    }
    bridge.signal(Signal::TERM);
    let log = ended(bridge).await;
    assert!(log.contains("waiting for it: start roscore"), "{log}");
}

#[tokio::test]
async fn a_node_with_the_same_name_takes_over_and_the_bridge_shuts_down() {
    let graph = Graph::new().await;
    let (bridge, device, uri) = (graph.bridge(), &graph.device, graph.master.uri());
    until("codes", async || device.controls.made.load(Relaxed) > 5).await;
    until("the services", async || registered(uri).await).await;
    let namesake = node("acquisition", uri).await;
    let _topic = subscribe(&namesake, "/encoded").await;
    let log = ended(bridge).await;
    assert!(log.contains("asks this node to shut down"), "{log}");
    assert_eq!(device.received().last(), Some(&ToDevice::Stop));
}

#[tokio::test]
async fn node_and_topics_can_be_renamed_on_the_command_line() {
    let graph = Graph::new().await;
    let bridge = Bridge::start(&[
        "--port",
        &graph.device.port,
        "--topic-prefix",
        "/left",
        "__name:=amplifier",
        "/left/encoded:=/neurodata",
        &format!("__master:={}", graph.master.uri()),
    ]);
    let mut encoded = graph.subscribe("/neurodata").await;
    frame(&mut encoded).await;
    let quit = "/left/amplifier/quit";
    until("the service", async || graph.node.call(quit, &EMPTY, &[]).await.is_ok()).await;
    ended(bridge).await;
}

#[tokio::test]
async fn nothing_is_decoded_while_nobody_subscribes_to_the_reconstruction() {
    let graph = Graph::new().await;
    let bridge = graph.bridge();
    sleep(Duration::from_secs(3)).await;
    bridge.signal(Signal::TERM);
    let log = ended(bridge).await;
    let summary = log.lines().last().unwrap();
    assert_has(summary, ["windows: decoded 0 not decoded 0"]);
    assert!(!summary.contains("not needed 0"), "{log}");
}

#[tokio::test]
async fn a_number_on_packed_rate_becomes_the_rate_of_the_device() {
    for (prefix, topic) in [
        (&[][..], "/acquisition/packed_rate"),
        (&["--topic-prefix=/left"], "/left/acquisition/packed_rate"),
    ] {
        let graph = Graph::new().await;
        let _bridge = graph.bridge_with(&[&["--streams=packed"][..], prefix].concat());
        let options = PublisherOptions { queue: 4, latch: true };
        let rates = graph.node.advertise(topic, UInt8::TYPE, options).await;
        let rates = rates.unwrap();
        let asked = || graph.device.rates();
        until("the model's rate", async || asked() == [4]).await;
        // 16 is not a valid rate, 9 is.
        rates.publish(&UInt8 { data: 16 }.to_bytes());
        rates.publish(&UInt8 { data: 9 }.to_bytes());
        until("the rate of the topic", async || asked() == [4, 9]).await;
    }
}

#[tokio::test]
async fn fillers_of_an_hour_push_no_code_out_of_a_queue_and_the_indices_show_the_gap() {
    let graph = Graph::new().await;
    let bridge = graph.bridge();
    let encoded = graph.node.subscribe("/encoded", NeuroFrame::TYPE, 70_000);
    let mut encoded = encoded.await.unwrap();
    let mut next = frame(&mut encoded).await.tri.data[1] + 1;
    let lost = 60_000;
    graph.device.controls.jump.store(lost, Relaxed);
    let (mut fillers, mut gaps, mut codes) = (0, Vec::new(), 0);
    while codes < 50 || fillers == 0 {
        let words = frame(&mut encoded).await.tri.data;
        let window = words[1] | words[2] << 16;
        if window != next {
            gaps.push(window - next);
        }
        next = window + 1;
        fillers += u32::from(words[0] & 0x8000 != 0);
        codes += u32::from(words[0] & 0x8000 == 0);
    }
    assert_eq!((fillers, gaps), (4096, vec![60_000 - 4096]));
    bridge.signal(Signal::TERM);
    let log = ended(bridge).await;
    assert_has(&log, ["lost 60000 (bursts 1, longest 60000) fillers 4096"]);
    assert!(log.contains("the outage was too long to fill"), "{log}");
    assert!(!log.contains("dropped for slow subscribers"), "{log}");
}
