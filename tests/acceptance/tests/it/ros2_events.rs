//! Frames and events reach a ROS 2 subscriber without a gap, with the stamps of the other outlets,
//! and each event is at its sample: after a restart of the board, a stop of the bridge, an
//! unplugged cable, while frames are lost, and with clocks that are not exact.

use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::process::Process;
use acceptance::programs::programs;
use acceptance::ros2::{Ros2, are_equal, as_ros1, messages};
use rustix::process::Signal;
use serde_json::Value;

/// Sampling rate of `/neurodata`, Hz.
const RATE: f64 = 512.0;
/// Number of status words of a sample, and the indices of two of them.
const WORDS: usize = 8;
const FLAGS: usize = 0;
const TRIGGER: usize = 7;
/// Code of the event of a rising edge of the trigger input.
const RISE: u64 = 1;
/// Largest permitted error of an event's time, seconds; the same as for recordings with ROS 1.
const TOLERANCE_S: f64 = 0.03;
/// Time for which all bridges run undisturbed, before and after the disturbances.
const CALM: Duration = Duration::from_secs(3);
/// Duration of the restart of a board and of the interruption of a cable.
const OUTAGE: Duration = Duration::from_secs(2);
/// Time for which the bridge's process stays stopped after the outage. It is longer than the DDS
/// lease of the bridge's subscriber, which is 10 s.
const STOP: Duration = Duration::from_secs(11);
/// Time from the end of the first stop of the bridge's process to a second stop, and duration of
/// the second stop. It is shorter than the time for which the bridge's messages wait.
const AGAIN: Duration = Duration::from_secs(2);
/// Longest wait for a program to end or to reach a condition, enough on a busy machine.
const SLACK: Duration = Duration::from_mins(1);

/// A scenario: a board whose clock is fast by `ppm` parts per million, the percentage of frames
/// that its cable loses (`None` without a cable), and the smallest and largest permitted total
/// duration of lost samples.
struct Scenario {
    name: &'static str,
    ppm: i32,
    cable: Option<u64>,
    lost_s: (f64, f64),
}

const RESTART: usize = 0;
const STOPPED: usize = 1;
const UNPLUGGED: usize = 2;
const SCENARIOS: [Scenario; 4] = [
    Scenario { name: "restart", ppm: -3_000, cable: None, lost_s: (1.9, 10.0) },
    // host-sim buffers 4 s of frames for a host that does not read, so a shorter time is lost than
    // the bridge is stopped for.
    Scenario { name: "stop", ppm: 300, cable: None, lost_s: (3.0, 13.0) },
    Scenario { name: "unplugged", ppm: 10_000, cable: Some(0), lost_s: (1.9, 10.0) },
    Scenario { name: "loss", ppm: 0, cable: Some(5), lost_s: (0.3, 5.0) },
];

struct Run {
    board: Process,
    /// Cable between board and bridge; `None` if they are connected by a pseudo-terminal.
    cable: Option<LossyCable>,
    bridge: Process,
}

fn board(folder: &Path, scenario: &Scenario, output: &str) -> Process {
    let mut command = Command::new(&programs().host_sim);
    command.args(["run", "--input=synthetic", "--realtime", "--quiet"]);
    command.args(["--trigger-every=0.7", "--output", output]);
    command.arg(format!("--clock-ppm={}", scenario.ppm));
    let name = format!("board of {}", scenario.name);
    Process::start(&name, &mut command, folder).expect("the board starts")
}

fn terminal(folder: &Path, scenario: &Scenario) -> String {
    folder.join(format!("{}.port", scenario.name)).display().to_string()
}

fn start(folder: &Path, ros2: &Ros2<'_>, scenario: &Scenario) -> Run {
    let (board, cable, port) = if let Some(percent) = scenario.cable {
        let port = free_port().expect("a free port");
        let board = board(folder, scenario, &format!("tcp:127.0.0.1:{port}"));
        let cable = LossyCable::new(port, percent).expect("a connection");
        let port = cable.port.clone();
        (board, Some(cable), port)
    } else {
        let port = terminal(folder, scenario);
        (board(folder, scenario, &format!("pty:{port}")), None, port)
    };
    let mut bridge = Command::new(&programs().bridge);
    bridge.args(["--sink=ros2,ndjson", "--streams=codes,raw,events"]);
    bridge.args(["--announce=raw", "--event-stamps=scalp"]);
    bridge.args(["--port", &port]);
    bridge.args(["--ros-args", "-r"]);
    bridge.arg(format!("__ns:=/{}", scenario.name));
    bridge.env("ROS_DOMAIN_ID", &ros2.domain);
    let bridge = Process::start(scenario.name, &mut bridge, folder).expect("the bridge starts");
    Run { board, cable, bridge }
}

fn seconds(message: &Value) -> f64 {
    let stamp = &message["header"]["stamp"];
    let part = |name: &str| stamp[name].as_f64().expect("a number");
    part("secs") + part("nsecs") / 1e9
}

/// Returns the times of the rising edges in the status words, by the stamps of the frames, and the
/// number of samples that are fillers.
#[expect(clippy::cast_precision_loss, reason = "indices in a frame")]
fn edges_and_fillers(frames: &[Value]) -> (Vec<f64>, usize) {
    let (mut edges, mut fillers, mut before) = (Vec::new(), 0, 1);
    for frame in frames {
        let words = frame["tri"]["data"].as_array().expect("status words");
        for (index, words) in words.chunks_exact(WORDS).enumerate() {
            let level = words[TRIGGER].as_u64().expect("a level");
            if (before, level) == (0, 1) {
                // The input rose between the sample before and this one.
                edges.push(seconds(frame) + (index as f64 - 0.5) / RATE);
            }
            before = level;
            fillers += usize::from(words[FLAGS].as_u64() >= Some(0x8000));
        }
    }
    (edges, fillers)
}

/// Checks that the received messages of a topic equal the sent ones, from the first received
/// message on.
fn check_received(topic: &str, sent: &[Value], received: &[Value]) {
    assert!(!received.is_empty(), "nothing of {topic}");
    let number = |message: &Value| message["neuroheader"]["seq"].as_u64();
    let first = sent.iter().position(|sent| number(sent) == number(&received[0]));
    let sent = &sent[first.expect("a message that was sent")..];
    let numbers: Vec<_> = received.iter().map(number).collect();
    let gap = numbers.windows(2).find(|pair| pair[1] != pair[0].map(|number| number + 1));
    assert_eq!(gap, None, "{topic} has a gap");
    assert_eq!(received.len(), sent.len(), "messages of {topic}");
    for (sent, received) in sent.iter().zip(received) {
        assert!(are_equal(sent, received), "{topic}: {sent} as {received}");
    }
}

#[test]
fn events_are_at_their_samples_whatever_happens_to_board_cable_and_bridge() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let Some(ros2) = Ros2::find("ROS 2 events", folder) else {
        return;
    };
    let topics = SCENARIOS.each_ref().map(|scenario| {
        let name = |topic: &str| format!("/{}{topic}", scenario.name);
        (name("/neurodata"), name("/events/bus"))
    });
    let arguments = topics.iter().flat_map(|(frames, events)| {
        let of = |name: &str, of: &str| format!("{name}=ros2neuro_msgs/{of}");
        [of(frames, "NeuroFrame"), of(events, "NeuroEvent")]
    });
    let arguments: Vec<String> = arguments.collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut subscriber = ros2.subscribe("subscriber", &ros2.domain, false, &arguments);
    let mut runs = SCENARIOS.each_ref().map(|scenario| start(folder, &ros2, scenario));
    subscriber.wait_until("frames of all", SLACK, |subscriber| {
        let lines = subscriber.output();
        topics.iter().all(|(frames, _)| lines.contains(&format!("\"{frames}\"")))
    });

    sleep(CALM);
    runs[RESTART].board.kill();
    runs[STOPPED].bridge.signal(Signal::STOP);
    let cable = runs[UNPLUGGED].cable.as_ref().expect("a cable");
    cable.unplug();
    sleep(OUTAGE);
    cable.plug();
    let output = format!("pty:{}", terminal(folder, &SCENARIOS[RESTART]));
    runs[RESTART].board = board(folder, &SCENARIOS[RESTART], &output);
    sleep(STOP);
    runs[STOPPED].bridge.signal(Signal::CONT);
    // Stop the bridge again while its node rejoins the domain.
    sleep(AGAIN);
    runs[STOPPED].bridge.signal(Signal::STOP);
    sleep(AGAIN);
    runs[STOPPED].bridge.signal(Signal::CONT);
    runs[STOPPED].bridge.wait_until("the return to the domain", SLACK, |bridge| {
        bridge.errors().contains("is in its domain again")
    });
    sleep(CALM);

    let mut ends = Vec::new();
    for run in runs {
        let errors = run.bridge.errors();
        let status = run.bridge.stop(Signal::TERM, SLACK);
        assert!(status.success(), "{errors}");
        ends.push(run.board);
    }
    assert!(subscriber.stop(Signal::TERM, SLACK).success());
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("output");
    let received = read("subscriber.out");
    for (scenario, (frames_topic, events_topic)) in SCENARIOS.iter().zip(&topics) {
        let errors = read(&format!("{}.err", scenario.name));
        assert!(errors.contains("; outlets: ros2 dropped 0, ndjson dropped 0"), "{errors}");
        let sent = read(&format!("{}.out", scenario.name));
        let received = |topic: &str| -> Vec<Value> {
            let received = messages(&received, topic).into_iter();
            received.map(as_ros1).collect()
        };
        let (frames, events) = (received(frames_topic), received(events_topic));
        check_received(frames_topic, &messages(&sent, frames_topic), &frames);
        check_received(events_topic, &messages(&sent, events_topic), &events);

        let rises = events.iter().filter(|event| event["event"].as_u64() == Some(RISE));
        let rises: Vec<f64> = rises.map(seconds).collect();
        let (edges, fillers) = edges_and_fillers(&frames);
        // Skip the first edge: events from before the first received frame can be missing.
        let edges: Vec<f64> = edges.into_iter().skip(1).collect();
        assert!(edges.len() >= 5, "{} edges", edges.len());
        let errors = edges.iter().map(|edge| {
            let errors = rises.iter().map(|rise| (rise - edge).abs());
            errors.fold(f64::INFINITY, f64::min)
        });
        let error_s = errors.fold(0.0, f64::max);
        #[expect(clippy::cast_precision_loss, reason = "seconds of samples")]
        let lost_s = fillers as f64 / RATE;
        println!(
            "{}: {} frames, {} edges, largest error of an event {:.2} ms, {lost_s:.1} s of fillers",
            scenario.name,
            frames.len(),
            edges.len(),
            error_s * 1e3
        );
        assert!(error_s < TOLERANCE_S, "{}: {error_s} s", scenario.name);
        let (least, most) = scenario.lost_s;
        assert!((least..most).contains(&lost_s), "{}: {lost_s} s of fillers", scenario.name);
    }
}
