//! Board, bridge, master and subscriber, up for one run.

use std::fs::File;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use neuro_ros::{NeuroFrame, RosMessage, Wire};
use ros1::{Master, Node, NodeOptions, Subscriber};
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;
use tokio::process::{Child, Command};
use tokio::time::{sleep_until, timeout};

use super::DemoOptions;
use super::live::Live;
use super::run::{Heard, Run};
use crate::failure::Failure;

/// Silence after which the path counts as broken: 80 codes.
const SILENCE: Duration = Duration::from_secs(5);
/// What starting may take on a busy machine.
const START: Duration = Duration::from_secs(20);
/// From the board's end to the last message.
const STRAGGLERS: Duration = Duration::from_millis(700);
/// Messages that may wait while we draw a bar.
const QUEUE: usize = 64;

/// Runs the whole path and returns what the subscriber heard.
///
/// # Errors
/// A part does not start, ends early or stays silent; Ctrl-C. Either way nothing is left running.
pub(crate) async fn run(options: DemoOptions, programs: &Path) -> Result<Run, Failure> {
    let folder = tempfile::tempdir().map_err(|error| Failure::Check {
        what: "making a temporary folder".to_owned(),
        why: error.to_string(),
        next: "is the disk full? is TMPDIR writable?".to_owned(),
    })?;
    tokio::select! {
        run = path(options, programs, &folder) => run,
        _ = tokio::signal::ctrl_c() => Err(Failure::Interrupted),
    }
}

async fn path(options: DemoOptions, programs: &Path, folder: &TempDir) -> Result<Run, Failure> {
    let live = Live::new(u64::from(options.seconds) * 16);
    let ours =
        |error: String| unreachable("the master in this program", &error, "is 127.0.0.1 up?");
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let master = Master::start(address)
        .await
        .map_err(|error| ours(error.to_string()))?;
    let node_options = NodeOptions {
        host: Some("127.0.0.1".to_owned()),
        ..NodeOptions::new("demo", master.uri())
    };
    let node = Node::start(node_options)
        .await
        .map_err(|error| ours(error.to_string()))?;
    let subscribe = async |topic| {
        let subscriber = node.subscribe(topic, NeuroFrame::TYPE, QUEUE).await;
        subscriber.map_err(|error| ours(error.to_string()))
    };
    let mut listener = Listener {
        codes: subscribe("/encoded").await?,
        reconstructed: subscribe("/neurodata_reconstructed").await?,
        run: Run::default(),
    };

    // The bridge first: it waits for its port, and so no code comes before the subscriber is linked.
    let port = folder.path().join("board");
    let port = port.to_string_lossy();
    let mut bridge = Program::start(
        &programs.join("corticode-bridge"),
        &["--port", &port, "--ros-master-uri", master.uri()],
        folder,
    )?;
    live.waiting("waiting for the bridge to announce its topics");
    listener.wait_for_links(&mut bridge).await?;
    let seconds = options.seconds.to_string();
    let seed = options.seed.to_string();
    let output = format!("pty:{port}");
    let mut board = Program::start(
        &programs.join("host-sim"),
        &[
            "run",
            "--input=synthetic",
            "--realtime",
            "--seed",
            &seed,
            "--duration",
            &seconds,
            "--output",
            &output,
        ],
        folder,
    )?;
    live.waiting("waiting for the first code");
    listener.listen(&live, &mut board, &mut bridge).await?;
    listener.run.made_by_board = codes_made(&board.log());
    drop(live);
    bridge.terminate().await?;
    node.shutdown().await;
    master.shutdown().await;
    Ok(listener.run)
}

/// The subscriber of the demo.
struct Listener {
    codes: Subscriber,
    reconstructed: Subscriber,
    run: Run,
}

impl Listener {
    /// Waits until the bridge offers both topics and the links are up.
    async fn wait_for_links(&mut self, bridge: &mut Program) -> Result<(), Failure> {
        let end = Instant::now() + START;
        while self.codes.publishers() == 0 || self.reconstructed.publishers() == 0 {
            bridge.must_run()?;
            if Instant::now() > end {
                return Err(bridge.silent("it announced no topic", START));
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        Ok(())
    }

    /// Hears until the board has ended and what it sent has arrived.
    async fn listen(
        &mut self,
        live: &Live,
        board: &mut Program,
        bridge: &mut Program,
    ) -> Result<(), Failure> {
        let mut deadline = Instant::now() + START;
        let mut board_ended = false;
        loop {
            tokio::select! {
                body = self.codes.recv() => {
                    self.run.codes.extend(heard(body));
                    live.heard(&self.run);
                    deadline = Instant::now() + if board_ended { STRAGGLERS } else { SILENCE };
                }
                body = self.reconstructed.recv() => self.run.reconstructed.extend(heard(body)),
                status = board.child.wait(), if !board_ended => {
                    if !status.is_ok_and(|status| status.success()) {
                        return Err(board.ended());
                    }
                    board_ended = true;
                    deadline = Instant::now() + STRAGGLERS;
                }
                _ = bridge.child.wait() => return Err(bridge.ended()),
                () = sleep_until(deadline.into()) => {
                    if board_ended {
                        return Ok(());
                    }
                    return Err(bridge.silent("no code came", SILENCE));
                }
            }
        }
    }
}

fn heard(body: Option<Vec<u8>>) -> Option<Heard> {
    let arrival = Instant::now();
    let frame = NeuroFrame::from_bytes(&body?).ok()?;
    Some(Heard { arrival, frame })
}

/// "... N codes made, ..." in the board's report.
fn codes_made(report: &str) -> Option<usize> {
    let (before, _) = report.rsplit_once(" codes made")?;
    before.rsplit(' ').next()?.parse().ok()
}

/// A program of ours that runs beside us; killed when dropped.
struct Program {
    name: String,
    child: Child,
    log: PathBuf,
}

impl Program {
    fn start(path: &Path, arguments: &[&str], folder: &TempDir) -> Result<Self, Failure> {
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let log = folder.path().join(format!("{name}.log"));
        let start = || {
            let file = File::create(&log)?;
            Command::new(path)
                .args(arguments)
                .stdin(Stdio::null())
                .stdout(file.try_clone()?)
                .stderr(file)
                // Ctrl-C is ours to handle: the terminal would send it to them too.
                .process_group(0)
                .kill_on_drop(true)
                .spawn()
        };
        match start() {
            Ok(child) => Ok(Self { name, child, log }),
            Err(error) => Err(unreachable(
                &name,
                &error.to_string(),
                "`cargo build --release`",
            )),
        }
    }

    fn log(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }

    fn must_run(&mut self) -> Result<(), Failure> {
        match self.child.try_wait() {
            Ok(None) => Ok(()),
            _ => Err(self.ended()),
        }
    }

    fn ended(&self) -> Failure {
        unreachable(
            &self.name,
            &format!("it ended early and said:\n{}", self.log()),
            "see its message",
        )
    }

    fn silent(&self, what: &str, patience: Duration) -> Failure {
        let why = format!(
            "{what} within {patience:?}; {} said:\n{}",
            self.name,
            self.log()
        );
        unreachable(
            "the path",
            &why,
            "is the machine very busy? `cargo demo` again",
        )
    }

    /// Asks it to leave as a service manager would, and expects that it does.
    async fn terminate(&mut self) -> Result<(), Failure> {
        if let Some(pid) = self
            .child
            .id()
            .and_then(|id| Pid::from_raw(id.cast_signed()))
        {
            // It may have ended between the two calls.
            let _ = kill_process(pid, Signal::TERM);
        }
        match timeout(SILENCE, self.child.wait()).await {
            Ok(Ok(status)) if status.success() => Ok(()),
            _ => Err(self.silent("it did not leave cleanly on SIGTERM", SILENCE)),
        }
    }
}

fn unreachable(what: &str, why: &str, next: &str) -> Failure {
    Failure::Unreachable {
        what: what.to_owned(),
        why: why.to_owned(),
        next: next.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_boards_own_count_is_read_from_its_report() {
        let report = "virtual board with model 00 on pty:x\n15.0 s of signal in 15.00 s (1.0 times real time): \
                      239 codes made, 0 frames dropped, 3 values clipped, 0 in codes (int8)\n";
        assert_eq!(codes_made(report), Some(239));
        assert_eq!(codes_made("nothing"), None);
    }
}
