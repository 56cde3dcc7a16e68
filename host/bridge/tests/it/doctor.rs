//! The subcommand `doctor`, on machines with and without faults.

use link::ToDevice;
use neuro_ros::ros1::xmlrpc::{Value as RosValue, call_ros};
use neuro_ros::ros1::{MessageType, PublisherOptions};
use serde_json::Value;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::graph::{master, node};
use crate::process::{Bridge, free_address, serve, wait_until};
use crate::trouble::stranger;

/// Runs `doctor` until it exits. Returns exit status and stdout.
fn doctor(arguments: &[&str], variables: &[(&str, &str)]) -> (Option<i32>, String) {
    let arguments = [&["doctor"], arguments].concat();
    let (status, text, log) = Bridge::start_with(&arguments, variables).output();
    assert_eq!(log, "", "{text}");
    (status, text)
}

/// Runs `doctor --json` until it exits. Returns exit status and the checks.
fn checks(arguments: &[&str], variables: &[(&str, &str)]) -> (Option<i32>, Vec<Value>) {
    let (code, text) = doctor(&[arguments, &["--json"]].concat(), variables);
    let report: Value = serde_json::from_str(&text).unwrap();
    (code, report["checks"].as_array().unwrap().clone())
}

/// Returns finding and remedy of the check `name`, after asserting that its level is `level`.
fn found<'a>(checks: &'a [Value], name: &str, level: &str) -> (&'a str, &'a str) {
    let check = checks.iter().find(|check| check["check"] == name);
    let check = check.unwrap_or_else(|| panic!("no check {name} in {checks:#?}"));
    assert_eq!(check["level"], level, "{check:#}");
    let text = |key: &str| check[key].as_str().unwrap_or_default();
    (text("finding"), text("remedy"))
}

/// Message type of the topics that another node publishes in the test.
static STRING: MessageType = MessageType {
    name: "std_msgs/String",
    md5: "992ce8a1687cec8c8bd883ec73ca41d1",
    definition: "string data\n",
};
const OPTIONS: PublisherOptions = PublisherOptions { queue: 1, latch: false };

#[tokio::test(flavor = "multi_thread")]
async fn a_machine_in_order_is_status_0() {
    let master = master().await;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("board");
    let device = Device::pty(Board::new(), &path);
    let arguments = ["--port", &device.port, "--ros-master-uri", master.uri()];
    wait_until("the pseudoterminal", || path.exists());
    let (code, text) = doctor(&arguments, &[]);
    println!("{text}");
    assert_eq!(code, Some(0), "{text}");
    let (code, checks) = checks(&arguments, &[]);
    assert_eq!(code, Some(0));
    for name in [
        "port",
        "permission",
        "other program",
        "device",
        "fault",
        "model",
        "ROS master",
        "own address",
        "topics",
        "use_sim_time",
    ] {
        let (finding, remedy) = found(&checks, name, "ok");
        assert!(text.contains(finding) && remedy.is_empty(), "{name}: {text}");
    }
    let (finding, _) = found(&checks, "device", "ok");
    assert!(finding.contains("board, firmware test") && finding.contains("wire format 1"));
    // `doctor` only asks a running device to identify itself, and does not change the device's
    // streams.
    let received = device.received();
    assert!(received.len() >= 2);
    let identify = |command: &ToDevice| *command == ToDevice::Identify;
    assert!(received.iter().all(identify), "{received:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn three_faults_at_once_have_their_remedies_and_status_1() {
    let folder = tempfile::tempdir().unwrap();
    let device = Device::pty(Board::new(), &folder.path().join("board"));
    let mut holder = Bridge::ndjson(&device.port);
    let mut messages = holder.messages();
    messages.next().unwrap();
    let dead = format!("http://{}/", free_address());
    let host = [("ROS_HOSTNAME", "no-such-host.invalid")];
    let arguments = ["--port", &device.port, "--ros-master-uri", &dead];
    let (code, text) = doctor(&arguments, &host);
    println!("{text}");
    assert_eq!(code, Some(1), "{text}");
    let (code, checks) = checks(&arguments, &host);
    assert_eq!(code, Some(1));
    let pid = holder.pid().to_string();
    let (finding, remedy) = found(&checks, "other program", "error");
    assert_has(finding, [&format!("corticode-bridge (pid {pid})")]);
    assert!(remedy.ends_with(&format!("kill {pid}")), "{remedy}");
    let (finding, remedy) = found(&checks, "ROS master", "error");
    assert_has(finding, [&dead]);
    assert!(remedy.starts_with("roscore"), "{remedy}");
    let (finding, remedy) = found(&checks, "own address", "error");
    assert_has(finding, ["no-such-host.invalid, which does not resolve"]);
    assert_has(remedy, ["unset ROS_HOSTNAME; export ROS_IP="]);
    found(&checks, "device", "unknown");
    let needs_master = |check: &Value| check["check"] == "topics";
    assert!(!checks.iter().any(needs_master), "{checks:?}");
    for check in &checks {
        let remedy = check["remedy"].as_str();
        assert_eq!(check["level"] == "ok", remedy.is_none(), "{check}");
        assert!(remedy.is_none_or(|remedy| text.contains(remedy)), "{text}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn faults_of_device_and_ros_graph_are_named() {
    let master = master().await;
    let filter = node("filter", master.uri()).await;
    let publisher = filter.advertise("/encoded", &STRING, OPTIONS).await;
    let _publisher = publisher.unwrap();
    let arguments = ["/test".into(), "/use_sim_time".into(), RosValue::Bool(true)];
    let set = call_ros(master.uri(), "setParam", &arguments).await;
    set.unwrap();
    let device = Device::tcp(Board::of_another_model());
    // No machine has this address: RFC 5737 reserves it for documentation.
    let variables = [("ROS_IP", "192.0.2.1")];
    let arguments = ["--port", &device.port, "--ros-master-uri", master.uri()];
    let (code, checks) = checks(&arguments, &variables);
    assert_eq!(code, Some(1));
    let (finding, remedy) = found(&checks, "topics", "error");
    assert_has(finding, ["/filter publishes /encoded"]);
    assert_has(remedy, ["rosnode kill /filter"]);
    let (_, remedy) = found(&checks, "use_sim_time", "warning");
    assert_has(remedy, ["rosparam set /use_sim_time false"]);
    let (finding, remedy) = found(&checks, "own address", "error");
    assert_has(finding, ["192.0.2.1), which is no address of this machine"]);
    assert_has(remedy, ["export ROS_IP="]);
    let (finding, remedy) = found(&checks, "model", "warning");
    assert!(finding.contains("0909090909090909") && remedy.contains("--model FOLDER"));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_topics_of_the_streams_that_are_asked_for_are_checked() {
    let master = master().await;
    let filter = node("filter", master.uri()).await;
    let publisher = filter.advertise("/neurodata", &STRING, OPTIONS).await;
    let _publisher = publisher.unwrap();
    let device = Device::tcp(Board::new());
    let arguments = ["--port", &device.port, "--ros-master-uri", master.uri()];
    let (_, default) = checks(&arguments, &[]);
    found(&default, "topics", "ok");
    let arguments = [&arguments[..], &["--streams", "raw"]].concat();
    let (_, with_raw) = checks(&arguments, &[]);
    let (finding, _) = found(&with_raw, "topics", "error");
    assert_has(finding, ["/filter publishes /neurodata"]);
}

#[test]
fn a_port_of_another_device_or_none_is_status_1() {
    let (stranger, closing) = (stranger(u32::MAX), serve(drop));
    for (port, name, expected, help) in [
        (&*stranger, "device", "nothing here speaks Corticode", "ports"),
        (&*closing, "device", "opens and closes again", "end the other"),
        ("/dev/ttyNOBODY", "port", "does not exist", "ports"),
        ("auto:NOBODY", "port", "no board NOBODY", "ports"),
    ] {
        let (code, checks) = checks(&["--port", port, "--sink", "ndjson"], &[]);
        assert_eq!(code, Some(1));
        let (finding, remedy) = found(&checks, name, "error");
        assert_has(finding, [expected]);
        assert_has(remedy, [help]);
        // With --sink ndjson the doctor does not check ROS.
        let is_of_ros = |check: &Value| check["check"] == "ROS master";
        assert!(!checks.iter().any(is_of_ros), "{checks:?}");
    }
}
