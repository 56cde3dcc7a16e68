//! Names in the ROS graph: namespaces, several bridges on one master, and other publishers of the
//! bridge's topics.

use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use neuro_ros::ros1::xmlrpc::{Value, call_ros};
use neuro_ros::ros1::{Node, PublisherOptions, Subscriber};
use neuro_ros::{
    DiagnosticArray, DiagnosticLevel, DiagnosticStatus, EMPTY, GET_ACQUISITION_INFO,
    GET_INFO_SERVICE, Log, NeuroFrame, RosMessage, Wire,
};
use rustix::process::Signal;
use tokio::time::{sleep, timeout};

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::graph::{Graph, announcement, ended, frame, master, node, registered, subscribe, until};
use crate::process::{Bridge, TIMEOUT};

const QUEUE: PublisherOptions = PublisherOptions { queue: 8, latch: false };

async fn diagnostics(node: &Node) -> Subscriber {
    let type_ = DiagnosticArray::TYPE;
    node.subscribe("/diagnostics", type_, 64).await.unwrap()
}

/// Waits for a report with a status for which `wanted` is true, and returns this status.
async fn status(
    reports: &mut Subscriber,
    wanted: impl Fn(&DiagnosticStatus) -> bool,
) -> DiagnosticStatus {
    let found = async {
        loop {
            let report = reports.recv().await.unwrap();
            let report = DiagnosticArray::from_bytes(&report).unwrap();
            if let Some(status) = report.status.into_iter().find(&wanted) {
                return status;
            }
        }
    };
    timeout(TIMEOUT, found).await.expect("the status")
}

async fn publishers(node: &Node, topic: &str) -> Vec<String> {
    let state = node.system_state().await.unwrap();
    state.publishers(topic).to_vec()
}

async fn end(bridge: Bridge) -> String {
    bridge.signal(Signal::TERM);
    ended(bridge).await
}

#[tokio::test]
async fn frames_are_not_published_beside_another_publisher_until_that_one_is_gone() {
    let graph = Graph::new().await;
    let filter = node("filterchain", graph.master.uri()).await;
    let type_ = NeuroFrame::TYPE;
    let other = filter.advertise("/encoded", type_, QUEUE).await.unwrap();
    let mut reports = diagnostics(&filter).await;
    let bridge = graph.bridge();
    let outlets = status(&mut reports, |status| {
        status.name.ends_with("outlets") && status.level == DiagnosticLevel::Error
    })
    .await;
    let message = "/encoded is not published beside /filterchain";
    assert_eq!(outlets.message, message);
    assert_eq!(publishers(&filter, "/encoded").await, ["/filterchain"]);
    let reconstructed = publishers(&filter, "/neurodata_reconstructed").await;
    assert_eq!(reconstructed, ["/acquisition"]);
    drop(other);
    let mut encoded = subscribe(&filter, "/encoded").await;
    frame(&mut encoded).await;
    // If another publisher appears, the bridge stops publishing the topic.
    let _other = filter.advertise("/encoded", type_, QUEUE).await.unwrap();
    until("the end of the publication", async || {
        publishers(&filter, "/encoded").await == ["/filterchain"]
    })
    .await;
    let log = end(bridge).await;
    let refusal = "/encoded is not published, because /filterchain publishes it too";
    assert_eq!(log.matches(refusal).count(), 2, "{log}");
    assert!(log.contains("/encoded is published again"), "{log}");
}

#[tokio::test]
async fn bridges_with_other_prefixes_and_namespaces_share_no_name_but_diagnostics() {
    let master = master().await;
    let (left, right) = (Device::tcp(Board::new()), Device::tcp(Board::new()));
    let uri = ["--ros-master-uri", master.uri(), "--port"];
    let prefixed = [&uri[..], &[&left.port, "--topic-prefix", "/left"]].concat();
    let spaced = [&uri[..], &[&right.port, "__ns:=/right"]].concat();
    let bridges = [Bridge::start(&prefixed), Bridge::start(&spaced)];
    let node = node("recorder", master.uri()).await;
    let mut reports = diagnostics(&node).await;
    for side in ["/left", "/right"] {
        announcement(&node, &format!("{side}/acquisition/get_info")).await;
        let name = format!("{side}/encoded");
        let mut encoded = subscribe(&node, &name).await;
        frame(&mut encoded).await;
        let bus = publishers(&node, &format!("{side}/events/bus")).await;
        assert_eq!(bus, [format!("{side}/acquisition")]);
        let link = format!("corticode {side}: link");
        status(&mut reports, |status| status.name == link).await;
    }
    assert!(!registered(master.uri()).await);
    assert!(publishers(&node, "/events/bus").await.is_empty());
    let stop = "/left/acquisition/stop";
    node.call(stop, &EMPTY, &[]).await.unwrap();
    for bridge in bridges {
        let log = end(bridge).await;
        let is_stopped = log.contains("~stop was called");
        assert_eq!(is_stopped, log.contains("/left/"), "{log}");
    }
}

#[tokio::test]
async fn get_info_fails_until_a_device_came_and_returns_when_another_bridge_leaves() {
    let graph = Graph::new().await;
    let (first, node) = (graph.bridge(), &graph.node);
    let announced = announcement(node, GET_INFO_SERVICE).await;
    let uri = ["--ros-master-uri", graph.master.uri()];
    let absent = ["--port=tcp:127.0.0.1:1", "__name:=other"];
    let second = Bridge::start(&[uri, absent].concat());
    until("the service of the other bridge", async || {
        let answer = node.call(GET_INFO_SERVICE, &GET_ACQUISITION_INFO, &[]);
        let failure = answer.await.err().map(|error| error.to_string());
        failure.is_some_and(|text| text.contains("no device has introduced itself yet"))
    })
    .await;
    end(second).await;
    let again = announcement(node, GET_INFO_SERVICE).await;
    assert_eq!(again, announced);
    end(first).await;
}

#[tokio::test]
async fn the_status_outlets_shows_how_far_each_subscriber_is_behind() {
    let graph = Graph::new().await;
    let bridge = graph.bridge();
    let mut encoded = graph.subscribe("/encoded").await;
    frame(&mut encoded).await;
    let mut reports = diagnostics(&graph.node).await;
    let key = "messages behind: /recorder on /encoded";
    let outlets =
        status(&mut reports, |status| status.values.iter().any(|value| value.key == key)).await;
    assert_eq!(outlets.name, "corticode: outlets");
    let lag = outlets.values.iter().find(|value| value.key == key);
    let lag = lag.unwrap().value.parse::<u32>().unwrap();
    assert!(lag < 50, "{lag}");
    end(bridge).await;
}

#[tokio::test]
async fn parameters_on_the_server_set_options_and_unknown_ones_are_status_2() {
    let master = master().await;
    let device = Device::tcp(Board::new());
    let set = async |name: &str, value: Value| {
        let arguments = [Value::from("/test"), format!("/acquisition/{name}").into(), value];
        let set = call_ros(master.uri(), "setParam", &arguments).await;
        set.unwrap();
    };
    set("port", device.port.as_str().into()).await;
    set("streams", Value::from(["codes", "raw"])).await;
    set("event_stamps", "nonsense".into()).await;
    let bridge = Bridge::start(&["--ros-master-uri", master.uri(), "_event_stamps:=scalp"]);
    let node = node("recorder", master.uri()).await;
    let mut raw = subscribe(&node, "/neurodata").await;
    frame(&mut raw).await;
    end(bridge).await;

    set("plugin", "eegdev".into()).await;
    let bridge = Bridge::start(&["--ros-master-uri", master.uri()]);
    let log = tokio::task::spawn_blocking(|| bridge.failure(2)).await;
    let remedy = "rosparam delete /acquisition/plugin";
    assert_has(&log.unwrap(), [remedy, "known are port, baud, sink"]);
}

#[tokio::test]
async fn host_names_that_do_not_resolve_are_in_the_log_once_with_what_to_do() {
    let device = Device::tcp(Board::new());
    // RFC 6761 reserves `.invalid` for names that never resolve.
    let uri = "http://no-such-master.invalid:11311/";
    let arguments = ["--port", &device.port, "--ros-master-uri", uri];
    let variables = [("ROS_HOSTNAME", "no-such-host.invalid")];
    let bridge = Bridge::start_with(&arguments, &variables);
    // The bridge calls the master every 0.5 s, and looks its own host up every 5 s.
    sleep(Duration::from_secs(7)).await;
    let log = end(bridge).await;
    for line in [
        "other nodes cannot connect to this one: ROS_HOSTNAME or ROS_IP is no-such-host.invalid, which does not \
         resolve: ",
        "the host name no-such-master.invalid of ROS_MASTER_URI does not resolve: ",
    ] {
        assert_eq!(log.matches(line).count(), 1, "{log}");
    }
    assert_has(&log, ["export ROS_IP=", "export ROS_MASTER_URI="]);
    assert!(!log.contains("roscore"), "{log}");
}

#[tokio::test]
async fn the_log_is_on_rosout_from_the_first_line() {
    let graph = Graph::new().await;
    let lines = graph.node.subscribe("/rosout", Log::TYPE, 64).await;
    let (mut lines, bridge) = (lines.unwrap(), graph.bridge());
    let mut next = async || {
        let line = timeout(TIMEOUT, lines.recv()).await.unwrap().unwrap();
        Log::from_bytes(&line).unwrap()
    };
    let first = next().await;
    assert_eq!((&*first.name, first.level), ("/acquisition", Log::INFO));
    assert!(first.msg.starts_with("node /acquisition at"), "{first:?}");
    while !next().await.msg.starts_with("streaming codes") {}
    graph.device.controls.hang_up.store(true, Relaxed);
    loop {
        let line = next().await;
        if line.msg.contains("was lost") {
            assert_eq!(line.level, Log::WARN);
            break;
        }
    }
    end(bridge).await;
}
