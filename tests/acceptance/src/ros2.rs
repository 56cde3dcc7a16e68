//! ROS 2 nodes made with other software: subscribers with Cyclone DDS, service callers with rclpy.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

use serde_json::{Map, Value};

use crate::process::Process;
use crate::wheels;
use crate::workspace;

/// Number of pairs of ROS domains whose ports are outside Linux's range for outgoing connections.
const PAIRS: u32 = 50;

/// The Python interpreter with ROS 2's packages, and two ROS domains that no other test uses.
#[derive(Debug)]
pub struct Ros2<'a> {
    python: PathBuf,
    folder: &'a Path,
    /// Domain of the test's nodes.
    pub domain: String,
    /// Another domain, from which the test's nodes must not be visible.
    pub other_domain: String,
}

impl<'a> Ros2<'a> {
    /// Finds the Python packages; if they are not installed, reports `test` as skipped and returns
    /// `None`. Programs write their output to `folder`.
    ///
    /// # Panics
    /// When the packages are not installed and `CORTICODE_REQUIRE_ROS=1`.
    pub fn find(test: &str, folder: &'a Path) -> Option<Self> {
        static TESTS: AtomicU32 = AtomicU32::new(0);
        let python = wheels::python(test)?;
        // Choose the first pair by the process id, so that tests in other processes usually use
        // other pairs.
        let start = std::process::id().wrapping_mul(0x9e37_79b9) >> 16;
        let pair = (start + TESTS.fetch_add(1, Ordering::Relaxed)) % PAIRS;
        Some(Self {
            python,
            folder,
            domain: (1 + 2 * pair).to_string(),
            other_domain: (2 + 2 * pair).to_string(),
        })
    }

    /// Starts a subscriber in `domain`. Each of the `topics` is TOPIC=PACKAGE/TYPE, and `latched`
    /// also requests messages from before the subscription (`tests/acceptance/ros2/subscribe.py`).
    ///
    /// # Panics
    /// When the subscriber does not start.
    pub fn subscribe(&self, name: &str, domain: &str, latched: bool, topics: &[&str]) -> Process {
        let mut command = self.command("subscribe.py");
        command.args(latched.then_some("--latched"));
        command.arg(domain).args(topics);
        Process::start(name, &mut command, self.folder).expect("the subscriber starts")
    }

    /// Calls services of the type `std_srvs/Empty`, one after the other, with rclpy.
    ///
    /// # Panics
    /// When a service is missing or does not answer.
    pub fn call(&self, services: &[&str]) {
        let mut command = self.command("call.py");
        let output = command.args(services).env("ROS_DOMAIN_ID", &self.domain);
        let output = output.output().expect("rclpy starts");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{services:?}: {errors}");
    }

    /// Calls services, one after the other, as programs with
    /// `RMW_IMPLEMENTATION=rmw_cyclonedds_cpp` do. Each service is NAME=PACKAGE/TYPE. Returns the
    /// responses in lines of JSON.
    ///
    /// # Panics
    /// When a service is missing or does not answer.
    pub fn call_with_cyclone(&self, services: &[&str]) -> String {
        let mut command = self.command("call_cyclone.py");
        let output = command.arg(&self.domain).args(services).output();
        let output = output.expect("Python starts");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{services:?}: {errors}");
        String::from_utf8(output.stdout).expect("JSON")
    }

    fn command(&self, script: &str) -> Command {
        let mut command = Command::new(&self.python);
        let path = workspace::root().join("tests/acceptance/ros2").join(script);
        command.arg(path).env("PYTHONUNBUFFERED", "1");
        // Let rclpy write its log to the test's folder.
        command.env("ROS_LOG_DIR", self.folder);
        command
    }
}

/// Returns the messages of `topic` in the lines of JSON of a subscriber or a bridge.
pub fn messages(lines: &str, topic: &str) -> Vec<Value> {
    let lines = lines.lines().filter_map(|line| serde_json::from_str(line).ok());
    let lines = lines.filter(|line: &Value| line["topic"] == topic);
    lines.map(|mut line| line["message"].take()).collect()
}

/// Returns a ROS 2 message with the field names of ROS 1: `secs` and `nsecs` in stamps, and the
/// sequence number in the header. As in the bridge's JSON lines, a stamp of time 0 is left out and
/// a diagnostic level is given by its name.
pub fn as_ros1(message: Value) -> Value {
    match message {
        Value::Array(items) => items.into_iter().map(as_ros1).collect(),
        Value::Object(fields) => {
            let number = fields.get("neuroheader").map_or(0.into(), |header| header["seq"].clone());
            let field = |(name, value): (String, Value)| {
                let (name, value) = match (name.as_str(), as_ros1(value)) {
                    ("sec", value) => ("secs".to_owned(), value),
                    ("nanosec", value) => ("nsecs".to_owned(), value),
                    ("level", value) => {
                        let names = ["ok", "warn", "error", "stale"];
                        let level = value.as_u64().and_then(|level| usize::try_from(level).ok());
                        let level = level.and_then(|level| names.get(level).copied());
                        (name, level.into())
                    }
                    ("header", mut value) => {
                        value["seq"] = number.clone();
                        (name, value)
                    }
                    (_, value) => (name, value),
                };
                let is_unset = name == "stamp" && value["secs"] == 0 && value["nsecs"] == 0;
                (!is_unset).then_some((name, value))
            };
            Value::Object(fields.into_iter().filter_map(field).collect::<Map<_, _>>())
        }
        other => other,
    }
}

/// Returns whether two messages are equal. Numbers with a fraction are compared as float32, the
/// type of samples.
pub fn are_equal(left: &Value, right: &Value) -> bool {
    match (left, right) {
        (Value::Array(left), Value::Array(right)) => {
            left.len() == right.len() && left.iter().zip(right).all(|(l, r)| are_equal(l, r))
        }
        (Value::Object(left), Value::Object(right)) => {
            let is_same = |(name, value)| right.get(name).is_some_and(|r| are_equal(value, r));
            left.len() == right.len() && left.iter().all(is_same)
        }
        #[expect(clippy::cast_possible_truncation, reason = "printed from a float32")]
        (Value::Number(left), Value::Number(right)) if left.is_f64() || right.is_f64() => {
            let as_f32 =
                |number: &serde_json::Number| number.as_f64().map(|x| (x as f32).to_bits());
            as_f32(left) == as_f32(right)
        }
        (left, right) => left == right,
    }
}
