//! Starts board, bridge, ROS master and subscriber for one run of the demo, and stops them.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use neuro_ros::{NeuroFrame, RosMessage, Wire};
use ros1::{Master, Node, NodeOptions, Subscriber};
use tokio::time::{sleep, sleep_until};

use crate::Failure;
use crate::program::{BOARD, BRIDGE, Program};
use crate::progress;
use crate::run::{Received, Run};

/// Rate at which the board makes codes, Hz.
const CODE_RATE_HZ: u64 = model::STEP_RATE_HZ as u64 / model::HOP as u64;
/// Time limit for the next code while the board runs: 80 times the normal 62.5 ms.
const SILENCE: Duration = Duration::from_secs(5);
/// Time limit for the bridge to announce its topics and for the first code to arrive; long enough
/// for a busy machine.
const START: Duration = Duration::from_secs(20);
/// After the board has ended, the run ends if no further code arrives for this time.
const STRAGGLERS: Duration = Duration::from_millis(700);
/// Number of messages that each subscription can queue while the progress bar is drawn.
const QUEUE: usize = 64;

/// Runs the whole signal path, then stops everything that was started. Returns what the subscriber
/// received.
///
/// # Errors
/// One of the programs does not start, ends early or does not respond in time.
pub(crate) async fn run(
    seconds: u32,
    seed: u64,
    programs: &Path,
    folder: &Path,
) -> Result<Run, Failure> {
    let bar = progress::bar(u64::from(seconds) * CODE_RATE_HZ);
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let master = Master::start(address).await.map_err(no_master)?;
    let node = Node::start(NodeOptions {
        host: Some("127.0.0.1".to_owned()),
        ..NodeOptions::new("demo", master.uri())
    });
    let node = node.await.map_err(no_master)?;
    let subscribe = async |topic| {
        let subscriber = node.subscribe(topic, NeuroFrame::TYPE, QUEUE).await;
        subscriber.map_err(no_master)
    };
    let mut listener = Listener {
        codes: subscribe("/encoded").await?,
        reconstructed: subscribe("/neurodata_reconstructed").await?,
        run: Run::default(),
    };

    // The bridge starts first and waits for the board's port to appear, so that the subscriber is
    // linked before the board makes its first code.
    let port = folder.join("board").to_string_lossy().into_owned();
    let arguments = ["--port", &port, "--ros-master-uri", master.uri(), "--config=/dev/null"];
    let mut bridge = Program::start(&programs.join(BRIDGE), &arguments, folder, None)?;
    bar.set_message("waiting for the bridge to announce its topics");
    listener.wait_for_links(&mut bridge).await?;
    let arguments = [
        "run",
        "--input=synthetic",
        "--realtime",
        &format!("--seed={seed}"),
        &format!("--duration={seconds}"),
        &format!("--output=pty:{port}"),
    ];
    let mut board = Program::start(&programs.join(BOARD), &arguments, folder, None)?;
    bar.set_message("waiting for the first code");
    listener.listen(&bar, &mut board, &mut bridge).await?;
    drop(bar);
    listener.run.made = codes_made(&board.log()).ok_or_else(|| board.ended())?;
    bridge.terminate(SILENCE).await?;
    node.shutdown().await;
    master.shutdown().await;
    Ok(listener.run)
}

/// Subscriptions to the bridge's topics, and the messages received so far.
struct Listener {
    codes: Subscriber,
    reconstructed: Subscriber,
    run: Run,
}

impl Listener {
    /// Waits until the bridge publishes both topics and the subscriber is linked to both.
    async fn wait_for_links(&self, bridge: &mut Program) -> Result<(), Failure> {
        let linked = async {
            while self.codes.publishers() == 0 || self.reconstructed.publishers() == 0 {
                sleep(Duration::from_millis(10)).await;
            }
        };
        tokio::select! {
            () = linked => Ok(()),
            _ = bridge.child.wait() => Err(bridge.ended()),
            () = sleep(START) => Err(bridge.timed_out("it announced no topic", START)),
        }
    }

    /// Receives messages until the board has ended and its last messages have arrived.
    async fn listen(
        &mut self,
        bar: &ProgressBar,
        board: &mut Program,
        bridge: &mut Program,
    ) -> Result<(), Failure> {
        let mut deadline = Instant::now() + START;
        let mut board_ended = false;
        loop {
            tokio::select! {
                body = self.codes.recv() => {
                    self.run.codes.extend(received(body));
                    progress::show(bar, &self.run);
                    deadline = Instant::now() + if board_ended { STRAGGLERS } else { SILENCE };
                }
                body = self.reconstructed.recv() => self.run.reconstructed.extend(received(body)),
                status = board.child.wait(), if !board_ended => {
                    if !status.is_ok_and(|status| status.success()) {
                        return Err(board.ended());
                    }
                    board_ended = true;
                    deadline = Instant::now() + STRAGGLERS;
                }
                _ = bridge.child.wait() => return Err(bridge.ended()),
                () = sleep_until(deadline.into()) => {
                    let silent = || bridge.timed_out("no code came", SILENCE);
                    return board_ended.then_some(()).ok_or_else(silent);
                }
            }
        }
    }
}

fn received(body: Option<Vec<u8>>) -> Option<Received> {
    let arrival = Instant::now();
    let frame = NeuroFrame::from_bytes(&body?).ok()?;
    Some(Received { arrival, frame })
}

/// Returns the number N from "... N codes made, ..." in the board's report.
fn codes_made(report: &str) -> Option<usize> {
    let (before, _) = report.rsplit_once(" codes made")?;
    before.rsplit(' ').next()?.parse().ok()
}

#[expect(clippy::needless_pass_by_value, reason = "for `map_err`")]
fn no_master(error: impl ToString) -> Failure {
    let what = "the master in this program";
    Failure::unreachable(what, error.to_string(), "is 127.0.0.1 up?")
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
