//! The programs, connections and subscribers of a run.

use std::env;
use std::fs::{self, File};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use indicatif::{ProgressBar, ProgressStyle};
use ros1::{Master, Node, NodeOptions};
use tempfile::TempDir;
use tokio::time::{interval, sleep};

use super::node_figures::Figures;
use super::part::Part;
use super::relay::Relay;
use super::rospy::Rospy;
use super::subscriber::Subscriber;
use super::usage::Usage;

/// Environment variable with the folder of host-sim and corticode-bridge; without it they are looked for
/// beside this program.
const FOLDER: &str = "CORTICODE_PROGRAMS";
const BOARD: &str = "host-sim";
const BRIDGE: &str = "corticode-bridge";
/// All programs that are measured.
pub(in crate::report) const PROGRAMS: [&str; 2] = [BOARD, BRIDGE];
/// Topic of the node in rospy.
const ROSPY_TOPIC: &str = "/rospy/encoded";
/// Longest time until the first code arrives at each subscriber, on a busy machine.
const START: Duration = Duration::from_secs(30);
/// Time before each part that is not measured: connections are new, and caches are cold.
const WARM_UP: Duration = Duration::from_secs(3);
/// Longest time after each part in which its last codes arrive, on a busy machine.
const STRAGGLERS: Duration = Duration::from_secs(10);

/// Folder of the programs that are measured.
#[derive(Debug)]
pub(in crate::report) struct Programs {
    pub(in crate::report) folder: PathBuf,
}

impl Programs {
    /// Finds the programs `names`, which the benchmark `benchmark` measures.
    ///
    /// # Errors
    /// A program is missing.
    pub(in crate::report) fn find(benchmark: &str, names: &[&str]) -> anyhow::Result<Self> {
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
        Ok(Self { folder })
    }

    /// Starts a program; its log goes to a file in `logs`.
    pub(in crate::report) fn start(
        &self,
        name: &str,
        logs: &Path,
        configure: impl FnOnce(&mut Command) -> &mut Command,
    ) -> anyhow::Result<Running> {
        let log = File::create(logs.join(name).with_extension("log"))?;
        let mut command = Command::new(self.folder.join(name));
        configure(&mut command)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log);
        let child = command.spawn();
        Ok(Running(
            child.with_context(|| format!("{name} does not start"))?,
        ))
    }
}

/// A child process; killed when dropped.
#[derive(Debug)]
pub(in crate::report) struct Running(pub(in crate::report) Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Fails if the process has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Both nodes with their source, a ROS master, and a subscriber of the codes of each.
#[derive(Debug)]
pub(super) struct Setup {
    bridge: Running,
    rospy: Option<Running>,
    _board: Running,
    relay: Relay,
    codes: Subscriber,
    rospy_codes: Subscriber,
    node: Node,
    _master: Master,
    progress: ProgressBar,
    _folder: TempDir,
}

impl Setup {
    /// Starts everything, for two parts of `seconds` each, and waits until both subscribers get codes.
    ///
    /// # Errors
    /// A program does not start, or no code comes.
    pub(super) async fn start(programs: &Programs, seconds: u32) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir()?;
        let any_port = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let master = Master::start(any_port).await?;
        let node = Node::start(NodeOptions {
            host: Some("127.0.0.1".to_owned()),
            ..NodeOptions::new("bench", master.uri())
        });
        let node = node.await?;
        let codes = Subscriber::start(&node, "/encoded").await?;
        let rospy_codes = Subscriber::start(&node, ROSPY_TOPIC).await?;

        let to_bridge = TcpListener::bind(any_port)?;
        let port = format!("tcp:{}", to_bridge.local_addr()?);
        let bridge = programs.start(BRIDGE, folder.path(), |bridge| {
            bridge
                .args(["--port", &port, "--ros-master-uri", master.uri()])
                .env("ROS_HOSTNAME", "127.0.0.1")
                .env_remove("ROS_IP")
                // Not the configuration of this user.
                .env("CORTICODE_CONFIG", "/dev/null")
        })?;
        let to_rospy = TcpListener::bind(any_port)?;
        let port = to_rospy.local_addr()?.port();
        let rospy = Rospy::find();
        let rospy = rospy.map(|rospy| rospy.start(master.uri(), port, ROSPY_TOPIC, folder.path()));
        let rospy = rospy.transpose()?.map(Running);
        // The port is free again when the listener is dropped; host-sim then takes it.
        let port = TcpListener::bind(any_port)?.local_addr()?.port();
        let signal = Duration::from_secs(2 * u64::from(seconds)) + START + 3 * WARM_UP;
        let board = programs.start(BOARD, folder.path(), |board| {
            board
                .args(["run", "--input=synthetic", "--realtime"])
                .arg(format!("--duration={}", signal.as_secs()))
                .arg(format!("--output=tcp:127.0.0.1:{port}"))
        })?;
        // The connections are made in another thread, because the master must answer meanwhile.
        let has_rospy = rospy.is_some();
        let relay = tokio::task::spawn_blocking(move || {
            Relay::start(port, &to_bridge, has_rospy.then_some(&to_rospy))
        });
        let logs = || {
            let log = fs::read_to_string(folder.path().join(BRIDGE).with_extension("log"));
            format!("{BRIDGE} printed:\n{}", log.unwrap_or_default())
        };
        let relay = relay.await?.with_context(logs)?;
        codes.wait_for_code(START).await?;
        if has_rospy {
            rospy_codes.wait_for_code(START).await?;
        }
        Ok(Self {
            bridge,
            rospy,
            _board: board,
            relay,
            codes,
            rospy_codes,
            node,
            _master: master,
            progress: progress(2 * u64::from(seconds)),
            _folder: folder,
        })
    }

    /// Subscribes to the signals that the bridge reconstructs.
    ///
    /// # Errors
    /// None arrives.
    pub(super) async fn subscribe_to_signals(&self) -> anyhow::Result<Subscriber> {
        let signals = Subscriber::start(&self.node, "/neurodata_reconstructed").await?;
        signals.wait_for_code(START).await?;
        Ok(signals)
    }

    /// Measures both nodes for `seconds`.
    ///
    /// # Errors
    /// A node has ended.
    pub(super) async fn measure(&self, name: &'static str, seconds: u32) -> anyhow::Result<Part> {
        sleep(WARM_UP).await;
        self.progress.set_message(name);
        let before = self.usage()?;
        let start = Instant::now();
        let mut ticks = interval(Duration::from_secs(1));
        ticks.tick().await;
        for _ in 0..seconds {
            ticks.tick().await;
            self.progress.inc(1);
        }
        let span = [start, Instant::now()];
        let after = self.usage()?;
        self.wait_for_stragglers(span[1]).await;
        let [to_bridge, to_rospy] = self.relay.times();
        let figures = |sent, subscriber: &Subscriber, place: usize| {
            let usage = after[place]?.since(&before[place]?);
            Some(Figures::new(sent, &subscriber.times(), span, &usage))
        };
        let bridge = figures(&to_bridge, &self.codes, 0).context("the bridge has ended")?;
        Ok(Part {
            name,
            bridge,
            rospy: figures(&to_rospy, &self.rospy_codes, 1),
        })
    }

    /// Waits until the codes that were sent before `end` have arrived, or are lost.
    async fn wait_for_stragglers(&self, end: Instant) {
        let deadline = Instant::now() + STRAGGLERS;
        let subscribers = [&self.codes, &self.rospy_codes];
        loop {
            let sent = self.relay.times();
            let mut both = sent.iter().zip(subscribers);
            let is_complete = both.all(|(sent, subscriber)| {
                let last = sent.iter().rev().find(|(_, at)| **at < end);
                last.is_none_or(|(window, _)| subscriber.times().contains_key(window))
            });
            if is_complete || Instant::now() >= deadline {
                return;
            }
            sleep(Duration::from_millis(50)).await;
        }
    }

    /// Returns the usage of the bridge and of the node in rospy.
    fn usage(&self) -> anyhow::Result<[Option<Usage>; 2]> {
        let rospy = self.rospy.as_ref().map(|rospy| Usage::of(rospy.0.id()));
        Ok([Some(Usage::of(self.bridge.0.id())?), rospy.transpose()?])
    }
}

fn progress(seconds: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} s  {msg}");
    ProgressBar::new(seconds).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
