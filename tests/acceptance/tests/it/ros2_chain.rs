//! Nodes of ROS 2, with DDS implementations that are not the bridge's, receive every message of the
//! bridge, and control it.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::process::Process;
use acceptance::programs::programs;
use acceptance::ros2::{Ros2, are_equal, as_ros1, messages};
use acceptance::workspace;
use rustix::process::Signal;
use serde_json::Value;

/// Duration of the EEG that the board sends, in seconds; `CORTICODE_ROS2_SECONDS` sets another one.
const SECONDS: u64 = 8;
/// Longest wait for a program to end or to reach a condition, enough on a busy machine.
const SLACK: Duration = Duration::from_mins(1);
/// Topics, each with its type in ROS 2.
const TOPICS: [&str; 6] = [
    "/encoded=ros2neuro_msgs/NeuroFrame",
    "/neurodata_reconstructed=ros2neuro_msgs/NeuroFrame",
    "/neurodata=ros2neuro_msgs/NeuroFrame",
    "/neurodata_corticode=ros2neuro_msgs/NeuroFrame",
    "/events/bus=ros2neuro_msgs/NeuroEvent",
    "/diagnostics=diagnostic_msgs/DiagnosticArray",
];

/// Options of the bridge that are not arguments of the launch file: `exit_at_end`, which is for
/// scripts, `open_browser`, which needs a desktop, and `topic_prefix`, which the argument `ns`
/// replaces.
const NOT_ARGUMENTS: [&str; 3] = ["exit_at_end", "open_browser", "topic_prefix"];

fn bridge(folder: &Path, ros2: &Ros2<'_>, port: &str, options: &[&str]) -> Process {
    let mut command = Command::new(&programs().bridge);
    command.args(["--port", port]).args(options);
    command.env("ROS_DOMAIN_ID", &ros2.domain);
    Process::start("bridge", &mut command, folder).expect("the bridge starts")
}

fn board(folder: &Path, seconds: u64, output: &str) -> Process {
    let mut command = Command::new(&programs().host_sim);
    let seconds = seconds.to_string();
    command.args(["run", "-q", "--input=synthetic", "--realtime", "--duration", &seconds]);
    command.args(["--trigger-every=0.5", "--clock-ppm=300", "--output", output]);
    Process::start("board", &mut command, folder).expect("the board starts")
}

/// Returns the number under `key` in the newest status `corticode: ros2` of the bridge's JSON
/// lines.
fn figure(lines: &str, key: &str) -> Option<u64> {
    let report = messages(lines, "/diagnostics").pop()?;
    let statuses = report["status"].as_array()?;
    let status = statuses.iter().find(|status| status["name"] == "corticode: ros2")?;
    let values = status["values"].as_array()?;
    let value = values.iter().find(|value| value["key"] == key)?;
    value["value"].as_str()?.parse().ok()
}

fn sequence(messages: &[Value]) -> Vec<u64> {
    let numbers = messages.iter().map(|message| &message["neuroheader"]["seq"]);
    numbers.map(|number| number.as_u64().expect("a number")).collect()
}

#[test]
fn every_message_reaches_a_subscriber_beside_one_that_stands_still_and_not_another_domain() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let Some(ros2) = Ros2::find("ROS 2 topics", folder) else {
        return;
    };
    let seconds = std::env::var("CORTICODE_ROS2_SECONDS");
    let seconds = seconds.map_or(SECONDS, |seconds| seconds.parse().expect("seconds"));
    let port = free_port().expect("a free port");
    let mut board = board(folder, seconds, &format!("tcp:127.0.0.1:{port}"));
    let cable = LossyCable::new(port, 5).expect("a connection");
    cable.unplug();
    let subscriber = ros2.subscribe("subscriber", &ros2.domain, false, &TOPICS);
    let still = ros2.subscribe("still", &ros2.domain, false, &TOPICS);
    let elsewhere = ros2.subscribe("elsewhere", &ros2.other_domain, false, &TOPICS);
    let options = ["--sink=ros2,ndjson", "--streams=codes,raw,filtered,events"];
    let mut bridge = bridge(folder, &ros2, &cable.port, &options);
    bridge.wait_until("both subscribers are known", SLACK, |bridge| {
        let lines = bridge.output();
        TOPICS.iter().all(|topic| {
            let (topic, _) = topic.split_once('=').expect("a type");
            figure(&lines, &format!("subscribers of {topic}")) == Some(2)
        })
    });
    still.signal(Signal::STOP);
    cable.plug();
    bridge.wait_until("the first codes", SLACK, |bridge| {
        messages(&bridge.output(), "/encoded").len() > 16
    });
    // The announcement was published before this subscriber connected.
    let info = "/acquisition/neurodata_info";
    let topic = format!("{info}=ros2neuro_msgs/NeuroFrame");
    let mut late = ros2.subscribe("late", &ros2.domain, true, &[&topic]);
    late.wait_until("the announcement", SLACK, |late| !messages(&late.output(), info).is_empty());
    let announced = messages(&late.output(), info).remove(0);

    assert!(board.wait(Duration::from_secs(seconds) + SLACK).success());
    // Wait for the decoder's frames, which come last.
    std::thread::sleep(Duration::from_secs(2));
    let errors = folder.join("bridge.err");
    let lines = folder.join("bridge.out");
    assert!(bridge.stop(Signal::TERM, SLACK).success());
    let received = folder.join("subscriber.out");
    assert!(subscriber.stop(Signal::TERM, SLACK).success());
    let read = |path| std::fs::read_to_string(path).expect("output");
    let (errors, lines, received) = (read(errors), read(lines), read(received));
    assert!(errors.contains("; outlets: ros2 dropped 0, ndjson dropped 0"), "{errors}");

    for topic in TOPICS {
        let (topic, _) = topic.split_once('=').expect("a type");
        let sent = messages(&lines, topic);
        let received = messages(&received, topic);
        // Skip the first reports, which were published before the subscriber connected.
        let skipped = if topic == "/diagnostics" { sent.len() - received.len() } else { 0 };
        let sent = &sent[skipped..];
        assert_eq!(received.len(), sent.len(), "messages of {topic}");
        let least = if topic.starts_with("/events") { 2 } else { 16 };
        let frames = usize::try_from(seconds).expect("few") * least - least;
        assert!(topic == "/diagnostics" || sent.len() >= frames, "{} of {topic}", sent.len());
        for (sent, received) in sent.iter().zip(received) {
            let received = as_ros1(received);
            assert!(are_equal(sent, &received), "{topic}: {sent} as {received}");
        }
    }
    let codes = messages(&received, "/encoded");
    let fillers = codes.iter().filter(|code| code["tri"]["data"][0].as_u64() >= Some(0x8000));
    assert!(fillers.count() > 0, "the cable loses frames");
    let shape = |frame: &Value| (frame["sr"].clone(), frame["eeg"]["info"].clone());
    assert_eq!(shape(&announced), shape(&codes[0]));
    assert_eq!(announced["eeg"]["info"]["labels"].as_array().map(Vec::len), Some(128));
    assert!(elsewhere.stop(Signal::TERM, SLACK).success());
    assert_eq!(read(folder.join("elsewhere.out")), "");
}

#[test]
fn services_answer_rclpy_and_restarted_programs_find_each_other_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let Some(ros2) = Ros2::find("ROS 2 services", folder) else {
        return;
    };
    let port = folder.join("board").display().to_string();
    let _board = board(folder, 300, &format!("pty:{port}"));
    let options = ["--sink=ros2", "--ros-args", "-r", "__ns:=/left", "-r", "/left/encoded:=/codes"];
    let start = || bridge(folder, &ros2, &port, &options);
    let codes = |process: &Process| messages(&process.output(), "/codes");
    let topic = "/codes=ros2neuro_msgs/NeuroFrame";
    let mut first = start();
    let mut subscriber = ros2.subscribe("first", &ros2.domain, false, &[topic]);
    subscriber.wait_until("codes", SLACK, |subscriber| codes(subscriber).len() > 16);

    ros2.call(&["/left/acquisition/stop"]);
    std::thread::sleep(Duration::from_secs(1));
    let stopped = codes(&subscriber).len();
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(codes(&subscriber).len(), stopped, "codes after stop");
    ros2.call(&["/left/acquisition/start"]);
    subscriber.wait_until("codes after start", SLACK, |subscriber| {
        codes(subscriber).len() > stopped + 16
    });

    subscriber.kill();
    let mut subscriber = ros2.subscribe("second", &ros2.domain, false, &[topic]);
    subscriber.wait_until("codes for another subscriber", SLACK, |subscriber| {
        codes(subscriber).len() > 16
    });
    ros2.call(&["/left/acquisition/quit"]);
    assert!(first.wait(SLACK).success(), "{}", first.log());
    let before = sequence(&codes(&subscriber));
    assert!(before.windows(2).all(|pair| pair[1] == pair[0] + 1), "{before:?}");

    let _second = start();
    subscriber.wait_until("codes of another bridge", SLACK, |subscriber| {
        codes(subscriber).len() > before.len() + 16
    });
    let after = sequence(&codes(&subscriber)[before.len()..]);
    assert!(after[0] < 100, "another bridge counts from 1: {after:?}");
    assert!(after.windows(2).all(|pair| pair[1] == pair[0] + 1), "{after:?}");
}

#[test]
fn services_answer_callers_with_cyclone_dds() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let Some(ros2) = Ros2::find("ROS 2 services with Cyclone DDS", folder) else {
        return;
    };
    let port = folder.join("board").display().to_string();
    let _board = board(folder, 300, &format!("pty:{port}"));
    let mut command = Command::new(&programs().bridge);
    command.args(["--sink=ros2,ndjson", "--port", &port]);
    command.env("ROS_DOMAIN_ID", &ros2.domain);
    command.env("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp");
    let mut bridge = Process::start("bridge", &mut command, folder).expect("the bridge starts");
    bridge.wait_until("codes", SLACK, |bridge| !messages(&bridge.output(), "/encoded").is_empty());
    let info = "/acquisition/get_info";
    let answers = ros2.call_with_cyclone(&[
        "/acquisition/stop=std_srvs/Empty",
        "/acquisition/start=std_srvs/Empty",
        &format!("{info}=ros2neuro_msgs/GetAcquisitionInfo"),
        "/acquisition/quit=std_srvs/Empty",
    ]);
    assert!(bridge.wait(SLACK).success(), "{}", bridge.log());
    assert_eq!(answers.lines().count(), 4, "{answers}");
    let told = messages(&answers, info).remove(0);
    let codes = messages(&bridge.output(), "/encoded");
    assert_eq!(told["result"], true, "{told}");
    assert_eq!(told["frame"]["sr"], codes[0]["sr"]);
    assert_eq!(told["frame"]["eeg"]["info"], codes[0]["eeg"]["info"]);
    assert_eq!(told["frame"]["eeg"]["info"]["labels"].as_array().map(Vec::len), Some(128));
}

#[test]
fn the_launch_file_has_every_option_and_the_bridge_takes_what_it_passes() {
    let launch = |arguments: &[&str]| -> Value {
        let root = workspace::root();
        let mut python = Command::new("python3");
        python.arg(root.join("tests/acceptance/ros2/launch_arguments.py"));
        python.arg(root.join("ros/ros2/corticode/launch/corticode.launch.py"));
        let output = python.args(arguments).output().expect("Python starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    let launched = launch(&["port:=/dev/board", "low_latency:=true", "ros2_qos:=sensor-data"]);
    let declared = launched["declared"].as_array().expect("a list").iter();
    let declared: BTreeSet<&str> = declared.filter_map(Value::as_str).collect();
    // The bridge lists its parameters when it refuses an unknown one.
    let refused = Command::new(&programs().bridge)
        .args(["--ros-args", "-p", "no_such_parameter:=1"])
        .output()
        .expect("the bridge starts");
    let errors = String::from_utf8_lossy(&refused.stderr);
    let (_, known) = errors.split_once("known are ").expect(&errors);
    let known = known.lines().next().expect("one line").split(", ");
    let lacking: Vec<&str> =
        known.filter(|name| !declared.contains(name) && !NOT_ARGUMENTS.contains(name)).collect();
    assert!(lacking.is_empty(), "corticode.launch.py lacks {lacking:?}");

    let arguments = launched["node"]["arguments"].as_array().expect("a list");
    let arguments: Vec<&str> = arguments.iter().filter_map(Value::as_str).collect();
    let expected =
        ["--sink=ros2", "--port=/dev/board", "--low-latency=true", "--ros2-qos=sensor-data"];
    assert_eq!(arguments.len(), expected.len());
    assert!(expected.iter().all(|option| arguments.contains(option)), "{arguments:?}");
    // Wrong usage would end with status 2 before the help is printed.
    let help = Command::new(&programs().bridge).args(arguments).arg("--help").output();
    assert!(help.expect("the bridge starts").status.success());
}
