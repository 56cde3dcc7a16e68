//! The chain of programs that a test runs: board, bridge, roscore, rospy subscriber and rosbag.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use rustix::process::Signal;
use serde::Deserialize;

use crate::process::Process;
use crate::programs::programs;
use crate::ros::{Ros, TIMEOUT};
use crate::workspace;

/// MD5 sum of ROS-Neuro's definition of NeuroFrame.
pub const NEURO_FRAME_MD5: &str = "797997e5036eb017437ce855856d3bad";

/// Device time from one code to the next, in microseconds.
const HOP_US: u64 = 62_500;

/// Flags that no code of an undisturbed run may have: adc_status_bad, overrun, filler
/// (docs/wire-format.md).
const BAD_FLAGS: u64 = 1 << 0 | 1 << 5 | 1 << 15;

/// Interval at which the output of the subscriber is checked for new messages.
const POLL: Duration = Duration::from_millis(20);

/// Longest time that a program may take to end after a signal.
const EXIT_TIMEOUT: Duration = Duration::from_secs(20);

/// A NeuroFrame, as `tests/acceptance/ros/subscribe.py` prints it.
#[derive(Debug, Clone, Deserialize)]
pub struct Message {
    /// Time of arrival in seconds of a monotonic clock.
    pub arrival: f64,
    /// MD5 sum in the publisher's connection header.
    pub md5: String,
    /// Type in the publisher's connection header.
    #[serde(rename = "type")]
    pub type_name: String,
    /// `header.seq`: number of the message, counted from 1.
    pub header_seq: u32,
    /// `header.stamp` in seconds since 1970.
    pub stamp: f64,
    /// `neuroheader.seq`: number of the message, counted from 1.
    pub seq: u32,
    /// `sr`, samples per second.
    pub sr: u16,
    /// `transducter` of the block `eeg`: what made its values, and the electrodes that were not
    /// recorded.
    pub transducter: String,
    /// Shape of the block with the code, or with the EEG samples.
    pub eeg: Block,
    /// Shape of the block with the spare channels; empty for codes.
    pub exg: Block,
    /// Shape of the block with the status words.
    pub tri: Block,
    /// Status words of the frame's first sample, by label.
    pub status: Status,
    /// Values of the code, or of the EEG samples, in the order of the message.
    pub values: Vec<f64>,
}

/// Shape of one block of a NeuroFrame, without its data.
#[derive(Debug, Clone, Deserialize, PartialEq)]
pub struct Block {
    /// Number of samples per channel.
    pub nsamples: u16,
    /// Number of channels; 0 if the block is empty.
    pub nchannels: u16,
    /// Number of bytes per sample over all channels.
    pub stride: u16,
    /// 1 for integers, 0 for floating point.
    pub isint: u8,
    /// Smallest and largest possible value of the block.
    pub minmax: Vec<f64>,
    /// One label per channel, in the order of the data.
    pub labels: Vec<String>,
    /// Number of values in the block.
    pub count: usize,
}

/// Status words of the block `tri`, 16 bits each.
#[derive(Debug, Clone, Deserialize)]
pub struct Status {
    /// Flags of the code (docs/wire-format.md).
    pub flags: u64,
    seq_lo: u64,
    seq_hi: u64,
    t_us_0: u64,
    t_us_1: u64,
    t_us_2: u64,
    /// Number of codes lost since the start of the session.
    pub lost: u64,
}

impl Status {
    /// Returns the index of the code's window, 0 for the first of the stream.
    pub fn window(&self) -> u64 {
        self.seq_lo | self.seq_hi << 16
    }

    /// Returns the device time in microseconds.
    pub fn device_us(&self) -> u64 {
        self.t_us_0 | self.t_us_1 << 16 | self.t_us_2 << 32
    }
}

/// A bridge between a port and a ROS master, with a subscriber to its codes and a recorder of them.
#[derive(Debug)]
pub struct Chain<'a> {
    /// The ROS master, and the environment of the ROS tools.
    pub ros: Ros<'a>,
    folder: &'a Path,
    bridge: Process,
    subscriber: Process,
    recorder: Process,
}

impl<'a> Chain<'a> {
    /// Starts everything but the board, and waits until the subscriber and the recorder are
    /// connected. The board is started by [`Self::board`].
    ///
    /// # Panics
    /// When a program does not start.
    pub fn start(folder: &'a Path) -> Self {
        Self::start_at(folder, &port(folder).to_string_lossy())
    }

    /// Like [`Self::start`], with options for the bridge.
    ///
    /// # Panics
    /// When a program does not start.
    pub fn start_with(folder: &'a Path, options: &[&str]) -> Self {
        let ros = Ros::start(folder).expect("roscore starts");
        Self::start_bridge(ros, folder, &port(folder).to_string_lossy(), options)
    }

    /// Like [`Self::start`], with the master of `corticode-bridge` instead of roscore.
    ///
    /// # Panics
    /// When a program does not start.
    pub fn start_without_roscore(folder: &'a Path) -> Self {
        let ros = Ros::start_master_of(&programs().bridge, folder).expect("the master starts");
        Self::start_bridge(ros, folder, &port(folder).to_string_lossy(), &[])
    }

    /// Like [`Self::start`], for a board at an address in the format of the bridge's `--port`.
    ///
    /// # Panics
    /// When a program does not start.
    pub fn start_at(folder: &'a Path, address: &str) -> Self {
        let ros = Ros::start(folder).expect("roscore starts");
        Self::start_bridge(ros, folder, address, &[])
    }

    fn start_bridge(ros: Ros<'a>, folder: &'a Path, address: &str, options: &[&str]) -> Self {
        let mut bridge = Command::new(&programs().bridge);
        bridge
            .args(["--ros-master-uri", &ros.master_uri(), "--port", address])
            .args(options)
            .env("ROS_HOSTNAME", "127.0.0.1")
            .env("CORTICODE_CONFIG", "/dev/null")
            .env_remove("ROS_IP");
        let bridge = Process::start("bridge", &mut bridge, folder).expect("the bridge starts");
        let subscriber = subscribe(&ros, folder, "subscriber", "/encoded");
        let mut record = ros.command("rosbag");
        record.args(["record", "--output-name=run.bag", "/encoded"]);
        let recorder = Process::start("recorder", &mut record, folder).expect("rosbag starts");
        let mut chain = Self {
            ros,
            folder,
            bridge,
            subscriber,
            recorder,
        };
        chain.wait_until_connected();
        chain
    }

    /// Starts `host-sim run` with these arguments as the board.
    ///
    /// # Panics
    /// When host-sim does not start.
    pub fn board(&self, arguments: &[&str]) -> Process {
        let mut board = Command::new(&programs().host_sim);
        board.arg("run").args(arguments).arg("--realtime");
        board.arg(format!("--output=pty:{}", port(self.folder).display()));
        Process::start("board", &mut board, self.folder).expect("host-sim starts")
    }

    /// Starts another subscriber to the codes, topic `/encoded`.
    pub fn another_subscriber(&self) -> Process {
        self.subscriber_of("/encoded")
    }

    /// Starts a subscriber to a topic that carries NeuroFrames.
    ///
    /// # Panics
    /// When the subscriber does not start.
    pub fn subscriber_of(&self, topic: &str) -> Process {
        let name = topic.trim_start_matches('/').replace('/', "-");
        subscribe(&self.ros, self.folder, &format!("of-{name}"), topic)
    }

    /// Returns the messages that the first subscriber has received so far.
    pub fn messages(&self) -> Vec<Message> {
        messages_of(&self.subscriber)
    }

    /// Waits until the first subscriber has received `messages` messages.
    ///
    /// # Panics
    /// When they have not arrived within [`TIMEOUT`].
    pub fn wait_for(&mut self, messages: usize) {
        let end = Instant::now() + TIMEOUT;
        while self.subscriber.output().lines().count() <= messages {
            assert!(
                Instant::now() < end,
                "{messages} messages at the subscriber: not within {TIMEOUT:?}:\n{}\n{}",
                self.subscriber.log(),
                self.bridge.log()
            );
            std::thread::sleep(POLL);
        }
    }

    /// Stops the recorder and the bridge by signals, as a user does. Returns the output of
    /// `rosbag info` for the recording.
    ///
    /// # Panics
    /// When a program does not exit cleanly.
    pub fn stop(self) -> String {
        let recorded = self.recorder.stop(Signal::INT, EXIT_TIMEOUT);
        assert!(recorded.success(), "rosbag record: {recorded}");
        let info = self.ros.tool("rosbag", &["info", "run.bag"]);
        let log = self.bridge.log();
        let exit = self.bridge.stop(Signal::TERM, EXIT_TIMEOUT);
        assert!(exit.success(), "the bridge on SIGTERM: {exit}\n{log}");
        info
    }

    /// Waits until the master lists the bridge, the subscriber and the recorder, and then 1 s for
    /// their connections.
    fn wait_until_connected(&mut self) {
        let Self { ros, bridge, .. } = self;
        bridge.wait_until("both subscribers are known to the master", TIMEOUT, |_| {
            let info = ros.command("rostopic").args(["info", "/encoded"]).output();
            let text = info.map(|info| String::from_utf8_lossy(&info.stdout).into_owned());
            text.is_ok_and(|text| text.matches(" * /").count() == 3)
        });
        std::thread::sleep(Duration::from_secs(1));
    }
}

/// Checks that the codes start at window 0, that no code is missing or repeated, and that the
/// device time of code number n, counted from 0, is n hops after that of the first code, within
/// `tolerance_us`.
///
/// # Panics
/// When a code is missing, repeated or wrong.
pub fn assert_continuous(messages: &[Message], tolerance_us: u64) {
    let start = messages[0].status.device_us();
    for (index, message) in (0..).zip(messages) {
        assert_eq!(message.md5, NEURO_FRAME_MD5);
        assert_eq!((message.sr, message.eeg.nchannels), (16, 128));
        assert_eq!(u64::from(message.seq), index + 1);
        assert_eq!(message.status.window(), index, "a gap");
        assert_eq!(message.status.lost, 0);
        assert_eq!(message.status.flags & BAD_FLAGS, 0, "code {index}");
        let error_us = (message.status.device_us() - start).abs_diff(index * HOP_US);
        assert!(
            error_us <= tolerance_us,
            "code {index} is {error_us} us off"
        );
    }
    for pair in messages.windows(2) {
        assert_ne!(pair[0].values, pair[1].values, "two codes are the same");
        assert!(pair[1].stamp > pair[0].stamp, "stamps go back: {pair:?}");
    }
}

/// Returns the number of codes per second, by the device times of the first and the last code; NaN
/// for fewer than two codes.
#[expect(clippy::cast_precision_loss, reason = "minutes in microseconds")]
pub fn rate(messages: &[Message]) -> f64 {
    let time = |message: &Message| message.status.device_us() as f64 * 1e-6;
    let [first, .., last] = messages else {
        return f64::NAN;
    };
    (messages.len() - 1) as f64 / (time(last) - time(first))
}

/// Returns the messages that a subscriber has received so far.
///
/// # Panics
/// When the subscriber's output does not have the format of `subscribe.py`.
pub fn messages_of(subscriber: &Process) -> Vec<Message> {
    let output = subscriber.output();
    let complete = output.rfind('\n').map_or("", |end| &output[..end]);
    complete
        .lines()
        .skip(1)
        .map(|line| serde_json::from_str(line).expect("a message"))
        .collect()
}

fn port(folder: &Path) -> PathBuf {
    folder.join("board-port")
}

/// Starts a rospy subscriber to a topic, with the Python class that genpy generates from
/// `ros/rosneuro_msgs`.
fn subscribe(ros: &Ros<'_>, folder: &Path, name: &str, topic: &str) -> Process {
    let script = workspace::root().join("tests/acceptance/ros/subscribe.py");
    let script = script.canonicalize().expect("the script exists");
    let mut python = ros.command("python3");
    python.arg(script).arg(topic);
    let mut subscriber = Process::start(name, &mut python, folder).expect("python3 starts");
    subscriber.wait_until("rospy subscribes", TIMEOUT, |subscriber| {
        subscriber.output().contains('\n')
    });
    let ready = subscriber.output();
    assert!(
        ready.contains(NEURO_FRAME_MD5),
        "genpy computes another MD5 sum: {ready}"
    );
    subscriber
}
