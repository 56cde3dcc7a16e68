//! Board, bridge, real roscore, rospy subscriber and rosbag: up for one test.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use rustix::process::Signal;
use serde::Deserialize;

use crate::process::Process;
use crate::programs::programs;
use crate::ros::{PATIENCE, Ros};
use crate::workspace;

/// ROS-Neuro's MD5 sum of NeuroFrame.
pub const NEURO_FRAME_MD5: &str = "797997e5036eb017437ce855856d3bad";

/// From one code to the next by the device's stamps, microseconds.
const HOP_US: u64 = 62_500;

/// Flags that no code of a sound run has, by their place: adc_status_bad, overrun, filler
/// (docs/wire-format.md).
const BAD_FLAGS: u64 = 1 << 0 | 1 << 5 | 1 << 15;

/// What ends a program that behaves.
const FAREWELL: Duration = Duration::from_secs(20);

/// A message as `tests/ros/subscribe.py` tells of it.
#[derive(Debug, Clone, Deserialize)]
pub struct Message {
    /// Arrival, seconds of a monotonic clock.
    pub arrival: f64,
    /// MD5 sum in the publisher's connection header.
    pub md5: String,
    /// Type in the publisher's connection header.
    #[serde(rename = "type")]
    pub type_name: String,
    /// `header.seq`.
    pub header_seq: u32,
    /// `header.stamp`, seconds since 1970.
    pub stamp: f64,
    /// `neuroheader.seq`.
    pub seq: u32,
    /// `sr`, samples per second.
    pub sr: u16,
    /// Shape of `eeg`.
    pub eeg: Block,
    /// Shape of `exg`.
    pub exg: Block,
    /// Shape of `tri`.
    pub tri: Block,
    /// The words of `tri` by label.
    pub status: Status,
    /// The numbers in `eeg`.
    pub values: Vec<f64>,
}

/// Shape of a block.
#[derive(Debug, Clone, Deserialize, PartialEq)]
pub struct Block {
    /// Samples per channel.
    pub nsamples: u16,
    /// Channels.
    pub nchannels: u16,
    /// Bytes of one sample of all channels.
    pub stride: u16,
    /// 1 if integers.
    pub isint: u8,
    /// Range.
    pub minmax: Vec<f64>,
    /// One per channel.
    pub labels: Vec<String>,
    /// Numbers in the block.
    pub count: usize,
}

/// Status words, 16 bits each.
#[derive(Debug, Clone, Deserialize)]
pub struct Status {
    /// Flags.
    pub flags: u64,
    seq_lo: u64,
    seq_hi: u64,
    t_us_0: u64,
    t_us_1: u64,
    t_us_2: u64,
    /// Codes lost so far.
    pub lost: u64,
}

impl Status {
    /// Index of the code since the device's start of the stream.
    pub fn window(&self) -> u64 {
        self.seq_lo | self.seq_hi << 16
    }

    /// Device time, microseconds.
    pub fn device_us(&self) -> u64 {
        self.t_us_0 | self.t_us_1 << 16 | self.t_us_2 << 32
    }
}

/// A bridge between a port and a roscore, with a subscriber and a recorder behind it.
#[derive(Debug)]
pub struct Chain<'a> {
    /// The real ROS.
    pub ros: Ros<'a>,
    folder: &'a Path,
    bridge: Process,
    subscriber: Process,
    recorder: Process,
}

impl<'a> Chain<'a> {
    /// Starts everything but the board, which [`Self::board`] starts, and waits until it is linked.
    ///
    /// # Panics
    /// When a part does not come up.
    pub fn start(folder: &'a Path) -> Self {
        Self::start_at(folder, &port(folder).to_string_lossy())
    }

    /// The same with other options of the bridge.
    ///
    /// # Panics
    /// When a part does not come up.
    pub fn start_with(folder: &'a Path, options: &[&str]) -> Self {
        Self::up(folder, &port(folder).to_string_lossy(), options)
    }

    /// The same for a board that will be at this address, as the bridge names it.
    ///
    /// # Panics
    /// When a part does not come up.
    pub fn start_at(folder: &'a Path, address: &str) -> Self {
        Self::up(folder, address, &[])
    }

    fn up(folder: &'a Path, address: &str, options: &[&str]) -> Self {
        let ros = Ros::start(folder).expect("roscore starts");
        let mut bridge = Command::new(&programs().bridge);
        bridge
            .args(["--ros-master-uri", &ros.master_uri(), "--port", address])
            .args(options)
            .env("ROS_HOSTNAME", "127.0.0.1")
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
        chain.wait_for_links();
        chain
    }

    /// Starts the virtual board with these arguments of `host-sim run`.
    ///
    /// # Panics
    /// When it does not start.
    pub fn board(&self, arguments: &[&str]) -> Process {
        let mut board = Command::new(&programs().host_sim);
        board.arg("run").args(arguments).arg("--realtime");
        board.arg(format!("--output=pty:{}", port(self.folder).display()));
        Process::start("board", &mut board, self.folder).expect("host-sim starts")
    }

    /// Another subscriber.
    pub fn another_subscriber(&self) -> Process {
        self.subscriber_of("/encoded")
    }

    /// A subscriber of another topic of NeuroFrames.
    ///
    /// # Panics
    /// When it does not start.
    pub fn subscriber_of(&self, topic: &str) -> Process {
        let name = topic.trim_start_matches('/').replace('/', "-");
        subscribe(&self.ros, self.folder, &format!("of-{name}"), topic)
    }

    /// What the first subscriber has heard so far.
    pub fn heard(&self) -> Vec<Message> {
        heard(&self.subscriber)
    }

    /// Waits until the first subscriber has heard so many messages.
    ///
    /// # Panics
    /// When it does not.
    pub fn wait_for(&mut self, messages: usize) {
        let what = format!("{messages} messages at the subscriber");
        self.subscriber.wait_until(&what, PATIENCE, |subscriber| {
            subscriber.output().lines().count() > messages
        });
    }

    /// Ends everything as a person would; returns what `rosbag info` says of the recording.
    ///
    /// # Panics
    /// When a part does not leave cleanly.
    pub fn end(self) -> String {
        let recorded = self.recorder.end(Signal::INT, FAREWELL);
        assert!(recorded.success(), "rosbag record: {recorded}");
        let info = self.ros.tool("rosbag", &["info", "run.bag"]);
        let log = self.bridge.log();
        let left = self.bridge.end(Signal::TERM, FAREWELL);
        assert!(left.success(), "the bridge on SIGTERM: {left}\n{log}");
        info
    }

    /// Both consumers know the bridge once the master lists them; their links follow at once.
    fn wait_for_links(&mut self) {
        let Self { ros, bridge, .. } = self;
        bridge.wait_until("both subscribers are known to the master", PATIENCE, |_| {
            let info = ros.command("rostopic").args(["info", "/encoded"]).output();
            let text = info.map(|info| String::from_utf8_lossy(&info.stdout).into_owned());
            text.is_ok_and(|text| text.matches(" * /").count() == 3)
        });
        std::thread::sleep(Duration::from_secs(1));
    }
}

/// Every code of the stream, each a hop after the one before, from a network that has an input; stamps may
/// be `off_us` off.
///
/// # Panics
/// When one is missing, wrong or repeated.
pub fn assert_whole(messages: &[Message], off_us: u64) {
    let begin = messages[0].status.device_us();
    for (index, message) in (0..).zip(messages) {
        assert_eq!(message.md5, NEURO_FRAME_MD5);
        assert_eq!((message.sr, message.eeg.nchannels), (16, 128));
        assert_eq!(u64::from(message.seq), index + 1);
        assert_eq!(message.status.window(), index, "a gap");
        assert_eq!(message.status.lost, 0);
        assert_eq!(message.status.flags & BAD_FLAGS, 0, "code {index}");
        let off = (message.status.device_us() - begin).abs_diff(index * HOP_US);
        assert!(off <= off_us, "code {index} is {off} us off");
    }
    for pair in messages.windows(2) {
        assert_ne!(pair[0].values, pair[1].values, "two codes are the same");
        assert!(pair[1].stamp > pair[0].stamp, "stamps go back: {pair:?}");
    }
}

/// Codes per second, by the stamps of the first and the last; not a number for fewer than two.
#[expect(clippy::cast_precision_loss, reason = "microseconds of minutes")]
pub fn rate(messages: &[Message]) -> f64 {
    let time = |message: &Message| message.status.device_us() as f64 * 1e-6;
    let [first, .., last] = messages else {
        return f64::NAN;
    };
    (messages.len() - 1) as f64 / (time(last) - time(first))
}

/// Messages that a subscriber has printed.
///
/// # Panics
/// When its lines are not what `subscribe.py` prints.
pub fn heard(subscriber: &Process) -> Vec<Message> {
    let output = subscriber.output();
    let whole = output.rfind('\n').map_or("", |end| &output[..end]);
    whole
        .lines()
        .skip(1)
        .map(|line| serde_json::from_str(line).expect("a message"))
        .collect()
}

fn port(folder: &Path) -> PathBuf {
    folder.join("board-port")
}

/// A rospy subscriber to a topic, with the class that genpy makes from our definition.
fn subscribe(ros: &Ros<'_>, folder: &Path, name: &str, topic: &str) -> Process {
    let script = workspace::root().join("tests/ros/subscribe.py");
    let script = script.canonicalize().expect("the script is there");
    let mut python = ros.command("python3");
    python.arg(script).arg(topic);
    let mut subscriber = Process::start(name, &mut python, folder).expect("python3 starts");
    subscriber.wait_until("rospy subscribes", PATIENCE, |subscriber| {
        subscriber.output().contains('\n')
    });
    let ready = subscriber.output();
    assert!(
        ready.contains(NEURO_FRAME_MD5),
        "genpy computes another MD5 sum: {ready}"
    );
    subscriber
}
