//! What the benchmarks of nodes share: our programs, a ROS master, a node in rospy for comparison,
//! and the figures of both nodes, measured at the same time.

mod amplifier;
pub(super) mod bridge;
mod figures;
pub(super) mod node;
mod relay;
mod subscriber;

use std::env;
use std::fs::{self, File};
use std::io::Write as _;
use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use neuro_ros::{NeuroFrame, RosMessage};
use picture::intervals::{Intervals, Series};
use ros1::{Master, Node, NodeOptions};
use serde_json::{Value as Json, json};
use tempfile::TempDir;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};
use tokio::time::sleep;

use self::figures::{Figures, Times, Usage};
use self::subscriber::Subscriber;
use super::programs::Python;

/// Environment variable that names the folder of our programs; default: this program's folder.
const FOLDER: &str = "CORTICODE_PROGRAMS";
/// Address at which a server listens on any free port of this PC.
const ANY_PORT: (Ipv4Addr, u16) = (Ipv4Addr::LOCALHOST, 0);
/// Time limit for the first code to arrive at each subscriber, enough on a busy machine.
const START: Duration = Duration::from_secs(30);
/// Warm-up before each measurement, in which connections and caches settle.
const WARM_UP: Duration = Duration::from_secs(3);
/// Time limit for the last codes to arrive after a measurement, enough on a busy machine.
const STRAGGLERS: Duration = Duration::from_secs(10);
/// Priority of the threads that send and receive, under `SCHED_FIFO`: higher than the priority of
/// the bridge with `--realtime`.
const PRIORITY: u8 = 30;
/// Length of the last part of a wait. In this part the thread spins, because a sleep can end this
/// much too late.
const BUSY: Duration = Duration::from_millis(2);

/// Folder that contains the programs to be measured.
#[derive(Debug)]
struct Programs(PathBuf);

impl Programs {
    /// Finds the folder of the programs `names`, which the benchmark `benchmark` measures.
    ///
    /// # Errors
    /// A program is missing.
    fn find(benchmark: &str, names: &[&str]) -> anyhow::Result<Self> {
        let own = env::current_exe().context("this program has no path")?;
        let folder = env::var_os(FOLDER).map(PathBuf::from);
        let folder = folder.unwrap_or_else(|| own.parent().unwrap_or(Path::new(".")).to_owned());
        for name in names {
            let path = folder.join(name);
            ensure!(
                path.exists(),
                "{} is missing\n  next: `cargo xtask bench {benchmark}` builds it",
                path.display()
            );
        }
        Ok(Self(folder))
    }

    /// Draws the histogram of the measured intervals between codes.
    fn draw(&self, benchmark: &str, intervals: &Intervals) -> anyhow::Result<()> {
        let folder = self.0.with_file_name("bench");
        let picture = folder.join(format!("{benchmark}-intervals.svg"));
        fs::create_dir_all(folder)
            .map_err(anyhow::Error::from)
            .and_then(|()| Ok(intervals.draw(&picture)?))
            .with_context(|| format!("{} cannot be written", picture.display()))?;
        eprintln!("picture: {}", picture.display());
        Ok(())
    }
}

/// A child process, which is killed when the value is dropped.
#[derive(Debug)]
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // An error means that the process has ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A ROS master, the ROS node through which this program subscribes, and a folder for logs.
#[derive(Debug)]
struct Ros {
    node: Node,
    master: Master,
    folder: TempDir,
}

impl Ros {
    async fn start() -> anyhow::Result<Self> {
        let master = Master::start(ANY_PORT.into()).await?;
        let options = NodeOptions {
            host: Some("127.0.0.1".to_owned()),
            ..NodeOptions::new("bench", master.uri())
        };
        Ok(Self { node: Node::start(options).await?, master, folder: tempfile::tempdir()? })
    }

    /// Starts one of our programs, with a file in the folder for its log.
    fn start_program(
        &self,
        programs: &Programs,
        name: &str,
        arguments: &[&str],
    ) -> anyhow::Result<Running> {
        let log = File::create(self.log(name))?;
        let mut command = Command::new(programs.0.join(name));
        command
            .args(arguments)
            .env("ROS_HOSTNAME", "127.0.0.1")
            .env_remove("ROS_IP")
            // Keep the program from reading the configuration of the user.
            .env("CORTICODE_CONFIG", "/dev/null")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log);
        let child = command.spawn();
        Ok(Running(child.with_context(|| format!("{name} does not start"))?))
    }

    /// Returns the path of the log of the program `name`.
    fn log(&self, name: &str) -> PathBuf {
        self.folder.path().join(name).with_extension("log")
    }

    /// Starts a script of this crate, which reads the definition of `NeuroFrame` from its stdin.
    fn start_script(
        &self,
        python: Python,
        script: &str,
        arguments: &[&str],
    ) -> anyhow::Result<Running> {
        let mut process = python
            .script(script)
            .args(arguments)
            .env("ROS_MASTER_URI", self.master.uri())
            .env("ROS_HOSTNAME", "127.0.0.1")
            .env("ROS_HOME", self.folder.path())
            .env_remove("ROS_IP")
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .with_context(|| format!("{script} does not start"))?;
        // Take the pipe, so that it is dropped here and the script's input ends.
        let mut definition = process.stdin.take().context("it has no standard input")?;
        definition.write_all(NeuroFrame::TYPE.definition.as_bytes())?;
        Ok(Running(process))
    }
}

/// Finds a Python interpreter that can import rospy.
fn find_rospy() -> Option<Python> {
    Python::find("rospy", "`apt-get install python3-rospy`, then again")
}

/// Returns a script's arguments: the length of the codes, and their rate in Hz.
fn code_arguments() -> [String; 2] {
    let rate_hz = usize::from(model::STEP_RATE_HZ) / model::HOP;
    [model::CODE, rate_hz].map(|number| number.to_string())
}

/// Runs the future of a benchmark; the ROS master and the subscribers also run on this thread.
fn block_on<T>(run: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    let mut runtime = tokio::runtime::Builder::new_current_thread();
    runtime.enable_all().build()?.block_on(run)
}

/// Waits until `due`: sleeps first, then spins for a more exact end.
fn wait_until(due: Instant) {
    thread::sleep(due.saturating_duration_since(Instant::now() + BUSY));
    while Instant::now() < due {
        std::hint::spin_loop();
    }
}

/// Gives this thread real-time priority where permitted, so that the figures contain only the
/// jitter of the nodes, not of the measurement.
fn run_before_others() {
    let Ok(priority) = ThreadPriorityValue::try_from(PRIORITY) else {
        return;
    };
    let (thread, priority) = (thread_native_id(), ThreadPriority::Crossplatform(priority));
    let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    // Without permission for real-time priority, the figures of both nodes include the jitter of
    // the measurement.
    let _ = set_thread_priority_and_policy(thread, priority, fifo);
}

/// Our node and the node in rospy, with a subscriber of each node's codes.
#[derive(Debug)]
struct Nodes {
    own: Running,
    /// Process of the node in rospy; `None` where rospy is not installed.
    rospy: Option<Running>,
    codes: [Subscriber; 2],
}

impl Nodes {
    /// Waits until a code from each running node has arrived.
    async fn wait_for_codes(&self) -> anyhow::Result<()> {
        for codes in self.measured_codes() {
            codes.wait_for_code(START).await?;
        }
        Ok(())
    }

    /// Returns the subscribers of the nodes that are running: one, or two with rospy.
    fn measured_codes(&self) -> &[Subscriber] {
        &self.codes[..=usize::from(self.rospy.is_some())]
    }

    /// Measures both nodes for `seconds`. `sent` returns, for each node, the times at which the
    /// codes, or the frames that complete their windows, were sent to the node.
    ///
    /// # Errors
    /// A node has ended.
    async fn measure(&self, seconds: u32, sent: impl Fn() -> [Times; 2]) -> anyhow::Result<Pair> {
        // Raise the priority only now, because nodes started after this call would inherit it.
        run_before_others();
        sleep(WARM_UP).await;
        let before = self.usage()?;
        let start = Instant::now();
        sleep(Duration::from_secs(seconds.into())).await;
        let span = [start, Instant::now()];
        let after = self.usage()?;
        self.wait_for_stragglers(span[1], &sent).await;
        let sent = sent();
        let figures = |place: usize| {
            let usage = after[place]?.since(&before[place]?);
            let arrived = self.codes[place].times();
            Some(Figures::new(&sent[place], &arrived, span, &usage))
        };
        Ok(Pair { own: figures(0).context("our node has ended")?, rospy: figures(1) })
    }

    /// Waits until the codes sent before `end` have arrived, but no longer than [`STRAGGLERS`].
    async fn wait_for_stragglers(&self, end: Instant, sent: &impl Fn() -> [Times; 2]) {
        let deadline = Instant::now() + STRAGGLERS;
        loop {
            let sent = sent();
            let is_complete = self.measured_codes().iter().zip(&sent).all(|(codes, sent)| {
                let last = sent.iter().rev().find(|(_, at)| **at < end);
                last.is_none_or(|(window, _)| codes.times().contains_key(window))
            });
            if is_complete || Instant::now() >= deadline {
                return;
            }
            sleep(Duration::from_millis(50)).await;
        }
    }

    fn usage(&self) -> anyhow::Result<[Option<Usage>; 2]> {
        let rospy = self.rospy.as_ref().map(|rospy| Usage::of(rospy.0.id()));
        Ok([Some(Usage::of(self.own.0.id())?), rospy.transpose()?])
    }
}

/// Figures of both nodes, measured at the same time.
#[derive(Debug)]
struct Pair {
    own: Figures,
    /// Figures of the node in rospy; `None` where rospy is not installed.
    rospy: Option<Figures>,
}

impl Pair {
    /// Returns a figure of our node divided by the same figure of the rospy node.
    fn ratio(&self, figure: &dyn Fn(&Figures) -> f64) -> Option<f64> {
        Some(figure(&self.own) / figure(self.rospy.as_ref()?))
    }

    /// Returns the figures of both nodes as JSON objects, named by `names`.
    fn objects(&self, names: [&str; 2]) -> Vec<Json> {
        let nodes = names.into_iter().zip([Some(&self.own), self.rospy.as_ref()]);
        let objects = nodes.filter_map(|(name, figures)| {
            let mut object = json!(figures?);
            object["name"] = name.into();
            Some(object)
        });
        objects.collect()
    }

    /// Returns a histogram of three kinds of intervals: between codes from our node, between codes
    /// sent to it, and between codes from the rospy node. `from` names the source of the codes.
    fn intervals(&self, [own, source, rospy]: [&str; 3], from: &str) -> Intervals {
        let series = |name: &str, ms: &[f64]| Series { name: name.to_owned(), ms: ms.to_owned() };
        let rival = self.rospy.as_ref();
        Intervals {
            arrival: series(own, &self.own.intervals_ms),
            source: series(source, &self.own.sent_intervals_ms),
            rival: rival.map(|rival| series(rospy, &rival.intervals_ms)),
            subtitle: format!(
                "{} codes {from} to a subscriber, all on this machine",
                self.own.codes
            ),
        }
    }
}

/// Asserts that a 2 s measurement has `count` nodes, each with about as many codes as are due.
#[cfg(test)]
fn assert_two_seconds(report: &super::figures::Report, count: std::ops::RangeInclusive<usize>) {
    assert_eq!(report.faults(), [""; 0]);
    let nodes = report.object["nodes"].as_array().expect("a list");
    assert!(count.contains(&nodes.len()), "{}", nodes.len());
    for node in nodes {
        let codes = node["codes"].as_u64().expect("a number");
        // An idle machine yields 32 codes.
        assert!((10..200).contains(&codes), "{node}");
        let latency = node["latency_median_ms"].as_f64().expect("a number");
        assert!(latency > 0.0, "{node}");
    }
}
