//! The programs that a test runs as a chain: a board, bridge, roscore, rospy subscriber and rosbag.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use rustix::process::Signal;
use serde::Deserialize;

use crate::process::Process;
use crate::programs::programs;
use crate::ros::{Ros, TIMEOUT};
use crate::workspace;

/// MD5 sum by which ROS identifies ROS-Neuro's definition of the message NeuroFrame.
pub const NEURO_FRAME_MD5: &str = "797997e5036eb017437ce855856d3bad";

/// Device time from one code to the next, in microseconds.
const HOP_US: u64 = 62_500;

/// Flags that no code of an undisturbed run may have: `adc_status_bad`, `overrun` and `filler`
/// (docs/wire-format.md).
const BAD_FLAGS: u64 = 1 << 0 | 1 << 5 | 1 << 15;

/// Time between two checks of the subscriber's output for new messages.
const POLL: Duration = Duration::from_millis(20);

/// Time limit for the bridge to exit after SIGTERM, and for the recorder after SIGINT.
const EXIT_TIMEOUT: Duration = Duration::from_mins(1);

/// A NeuroFrame that the subscriber `tests/acceptance/ros/subscribe.py` has received and printed.
#[derive(Debug, Clone, Deserialize)]
pub struct Message {
    /// MD5 sum of the message's definition, from the header of the publisher's connection.
    pub md5: String,
    /// Name of the message's type, from the header of the publisher's connection.
    #[serde(rename = "type")]
    pub type_name: String,
    /// `header.seq`: number of the message, counted from 1.
    pub header_seq: u32,
    /// `header.stamp`: time stamp of the message, in seconds since 1970.
    pub stamp: f64,
    /// `neuroheader.seq`: number of the message, counted from 1.
    pub seq: u32,
    /// `sr`: samples per second.
    pub sr: u16,
    /// `transducter` of the block `eeg`: the source of its values, and the electrodes that were not
    /// recorded.
    pub transducter: String,
    /// Shape of the block `eeg`, which holds the code or, on the topic of samples, the EEG samples.
    pub eeg: Block,
    /// Shape of the block `exg`, which holds the samples of the spare channels; empty for codes.
    pub exg: Block,
    /// Shape of the block `tri`, which holds the status words.
    pub tri: Block,
    /// Status words of the frame's first sample, each under its label.
    pub status: Status,
    /// Values of the block `eeg`: the numbers of the code, or the EEG samples.
    pub values: Vec<f64>,
}

/// Shape of one block of a NeuroFrame, without the block's data.
#[derive(Debug, Clone, Deserialize, PartialEq)]
pub struct Block {
    /// Number of samples per channel.
    pub nsamples: u16,
    /// Number of channels; 0 if the block is empty.
    pub nchannels: u16,
    /// Number of bytes that one sample of all channels takes.
    pub stride: u16,
    /// 1 if the values are integers, 0 if they are floating-point numbers.
    pub isint: u8,
    /// Smallest and largest value that the block can contain.
    pub minmax: Vec<f64>,
    /// Label of each channel, in the order in which the data lists the channels.
    pub labels: Vec<String>,
    /// Number of values in the block.
    pub count: usize,
}

/// Status words, 16 bits each, that a NeuroFrame carries in its block `tri`.
#[derive(Debug, Clone, Deserialize)]
pub struct Status {
    /// Flags of the code, whose bits docs/wire-format.md defines.
    pub flags: u64,
    seq_lo: u64,
    seq_hi: u64,
    t_us_0: u64,
    t_us_1: u64,
    t_us_2: u64,
    /// Number of codes that the bridge has counted as lost since the start of the session.
    pub lost: u64,
}

impl Status {
    /// Returns the number of the code's window, counted from 0 at the start of the stream.
    pub fn window(&self) -> u64 {
        self.seq_lo | self.seq_hi << 16
    }

    /// Returns the device's time stamp of the code, in microseconds.
    pub fn device_us(&self) -> u64 {
        self.t_us_0 | self.t_us_1 << 16 | self.t_us_2 << 32
    }
}

/// A bridge between a port and a ROS master, with a subscriber to the codes and a recorder.
#[derive(Debug)]
pub struct Chain<'a> {
    /// The ROS master; it also creates commands for ROS tools that connect to it.
    pub ros: Ros<'a>,
    folder: &'a Path,
    bridge: Process,
    subscriber: Process,
    recorder: Process,
}

impl<'a> Chain<'a> {
    /// Starts roscore, the bridge, a subscriber and a recorder, and waits until subscriber and
    /// recorder are connected. A board is started later, by [`Self::board`].
    ///
    /// # Panics
    /// When a program does not start.
    pub fn start(folder: &'a Path) -> Self {
        Self::start_at(folder, &port(folder).to_string_lossy())
    }

    /// Like [`Self::start`], but the bridge gets `options` as further arguments.
    ///
    /// # Panics
    /// When a program does not start.
    pub fn start_with(folder: &'a Path, options: &[&str]) -> Self {
        let ros = Ros::start(folder).expect("roscore starts");
        Self::start_bridge(ros, folder, &port(folder).to_string_lossy(), options)
    }

    /// Like [`Self::start`], but `corticode-bridge` provides the ROS master instead of roscore.
    ///
    /// # Panics
    /// When a program does not start.
    pub fn start_without_roscore(folder: &'a Path) -> Self {
        let ros = Ros::start_master_of(&programs().bridge, folder).expect("the master starts");
        Self::start_bridge(ros, folder, &port(folder).to_string_lossy(), &[])
    }

    /// Like [`Self::start`], for a board at `address`, in the format of the bridge's `--port`.
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
        let mut chain = Self { ros, folder, bridge, subscriber, recorder };
        chain.wait_until_connected();
        chain
    }

    /// Starts `host-sim run` with `arguments`; it simulates the board to which the bridge connects.
    ///
    /// # Panics
    /// When host-sim does not start.
    pub fn board(&self, arguments: &[&str]) -> Process {
        let mut board = Command::new(&programs().host_sim);
        board.arg("run").args(arguments).arg("--realtime");
        board.arg(format!("--output=pty:{}", port(self.folder).display()));
        Process::start("board", &mut board, self.folder).expect("host-sim starts")
    }

    /// Starts a subscriber to `topic`, which must carry NeuroFrames.
    ///
    /// # Panics
    /// When the subscriber does not start.
    pub fn subscriber_of(&self, topic: &str) -> Process {
        let name = topic.trim_start_matches('/').replace('/', "-");
        subscribe(&self.ros, self.folder, &format!("of-{name}"), topic)
    }

    /// Returns the messages that the subscriber started with the chain has received so far.
    pub fn messages(&self) -> Vec<Message> {
        messages_of(&self.subscriber)
    }

    /// Waits until the subscriber started with the chain has received `messages` messages.
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

    /// Stops the recorder with SIGINT and the bridge with SIGTERM, as a user would. Returns what
    /// `rosbag info` prints about the recorded bag.
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

    /// Waits until the master lists the bridge, the subscriber and the recorder as nodes, and then
    /// 1 s more for them to connect to each other.
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

/// Checks that the codes start at window 0, and that none is missing or repeated. The device time
/// of code n, counted from 0, must be n hops later than that of the first code.
///
/// # Panics
/// When a code is missing, repeated or has another device time.
pub fn assert_continuous(messages: &[Message]) {
    let start = messages[0].status.device_us();
    for (index, message) in (0..).zip(messages) {
        assert_eq!(message.md5, NEURO_FRAME_MD5);
        assert_eq!((message.sr, message.eeg.nchannels), (16, 128));
        assert_eq!(u64::from(message.seq), index + 1);
        assert_eq!(message.status.window(), index, "a gap");
        assert_eq!(message.status.lost, 0);
        assert_eq!(message.status.flags & BAD_FLAGS, 0, "code {index}");
        assert_eq!(message.status.device_us() - start, index * HOP_US);
    }
    for pair in messages.windows(2) {
        assert_ne!(pair[0].values, pair[1].values, "two codes are the same");
        assert!(pair[1].stamp > pair[0].stamp, "stamps go back: {pair:?}");
    }
}

/// Returns the messages that `subscriber` has received so far.
///
/// # Panics
/// When its output does not have the format of `subscribe.py`.
pub fn messages_of(subscriber: &Process) -> Vec<Message> {
    let output = subscriber.output();
    let complete = output.rfind('\n').map_or("", |end| &output[..end]);
    complete.lines().skip(1).map(|line| serde_json::from_str(line).expect("a message")).collect()
}

fn port(folder: &Path) -> PathBuf {
    folder.join("board-port")
}

/// Starts a rospy subscriber to `topic`. It uses the Python class that genpy generates from the
/// definitions in `ros/rosneuro_msgs`.
fn subscribe(ros: &Ros<'_>, folder: &Path, name: &str, topic: &str) -> Process {
    let script = workspace::root().join("tests/acceptance/ros/subscribe.py");
    let script = script.canonicalize().expect("the script exists");
    let mut python = ros.command("python3");
    python.arg(script).arg(topic);
    let mut subscriber = Process::start(name, &mut python, folder).expect("python3 starts");
    subscriber
        .wait_until("rospy subscribes", TIMEOUT, |subscriber| subscriber.output().contains('\n'));
    let ready = subscriber.output();
    assert!(ready.contains(NEURO_FRAME_MD5), "genpy computes another MD5 sum: {ready}");
    subscriber
}
