//! Nodes that encode streams of the Lab Streaming Layer, and players that send the streams.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use acceptance::lsl_recording::{start as python, unique};
use acceptance::process::Process;
use acceptance::ros::{Ros, TIMEOUT};
use acceptance::wheels::liblsl;
use neuro_ros::ros1::{Node, Subscriber};
use neuro_ros::{NeuroFrame, Wire};
use pipeline::Mains;
use rustix::process::Signal;

use crate::node_chain::{EXIT_TIMEOUT, Eeg, SAMPLES, is_filler, start_node, subscribe};

/// Time without a code after which, once the player has ended, no more codes are expected.
const SILENCE: Duration = Duration::from_secs(2);

/// A node that encodes a stream of the Lab Streaming Layer.
pub(super) struct Session {
    folder: PathBuf,
    stream: String,
    pub(super) node: Process,
    _listener: Node,
    encoded: Subscriber,
}

impl Session {
    /// Starts a node in the namespace `name`. The node takes the stream's values as microvolts.
    pub(super) async fn start(
        ros: &Ros<'_>,
        interpreter: &Path,
        folder: &Path,
        name: &str,
    ) -> Session {
        let folder = folder.join(name);
        fs::create_dir(&folder).expect("a folder");
        let stream = unique(name);
        let options = [
            &format!("__ns:=/{name}"),
            &format!("--source=lsl:{stream}"),
            &format!("--liblsl={}", liblsl(interpreter).display()),
            "--source-unit=microvolts",
        ];
        let node = start_node(ros, &folder, &options);
        let topic = format!("/{name}/encoded");
        let (listener, encoded) = subscribe::<NeuroFrame>(ros, &topic, &node).await;
        Session { folder, stream, node, _listener: listener, encoded }
    }

    /// Starts a player that sends `eeg` to this node.
    pub(super) fn play(&self, interpreter: &Path, eeg: &Eeg, options: &[&str]) -> Process {
        play(interpreter, &self.folder, &self.stream, eeg, options)
    }

    /// Waits until `player` has ended and no more codes come, then stops the node.
    pub(super) async fn finish(mut self, mut player: Process) -> Published {
        let mut frames: Vec<NeuroFrame> = Vec::new();
        loop {
            match tokio::time::timeout(SILENCE, self.encoded.recv()).await {
                Ok(body) => {
                    let body = body.expect("the node runs");
                    frames.push(NeuroFrame::from_bytes(&body).expect("a NeuroFrame"));
                }
                Err(_) if player.is_running() => {}
                Err(_) => break,
            }
        }
        assert!(player.wait(TIMEOUT).success(), "{}", player.log());
        let log = self.node.errors();
        let exit = self.node.stop(Signal::INT, EXIT_TIMEOUT);
        assert!(exit.success(), "{exit}: {log}");
        for pair in frames.windows(2) {
            assert_eq!(pair[1].neuroheader.seq, pair[0].neuroheader.seq + 1);
            assert!(pair[1].header.stamp > pair[0].header.stamp, "{}: {log}", self.stream);
        }
        Published { stream: self.stream, frames, start_s: start_s(&player), log }
    }
}

/// Returns the time at which a player's first sample was taken, seconds on the wall clock.
fn start_s(player: &Process) -> f64 {
    let output = player.output();
    let start = output.lines().next().and_then(|line| line.parse().ok());
    start.expect("the player has started")
}

/// What a node has published for a stream.
pub(super) struct Published {
    pub(super) stream: String,
    pub(super) frames: Vec<NeuroFrame>,
    /// Time of the newest player's first sample, seconds on the wall clock.
    start_s: f64,
    pub(super) log: String,
}

impl Published {
    /// Returns the codes that are no fillers, each with its index among all frames.
    pub(super) fn codes(&self) -> Vec<(usize, &[f32])> {
        let frames = self.frames.iter().enumerate();
        let codes = frames.filter(|(_, frame)| !is_filler(frame));
        codes.map(|(place, frame)| (place, &*frame.eeg.data)).collect()
    }

    /// Returns how much later the stamp of the frame with index `place` is than expected, in
    /// seconds. The expected stamp is the time of the first sample in the code's window, `made_s`
    /// seconds after the player's start, less the filters' group delay.
    pub(super) fn lateness_s(&self, place: usize, made_s: f64) -> f64 {
        let delay_s = f64::from(Mains::Hz50.filter().group_delay_us) * 1e-6;
        let stamp_ns = self.frames[place].header.stamp.nanoseconds();
        #[expect(clippy::cast_precision_loss, reason = "to a quarter of a microsecond")]
        let stamp_s = stamp_ns as f64 * 1e-9;
        stamp_s - (self.start_s + made_s - delay_s)
    }
}

/// Starts a player that sends `eeg` as the stream `name`. The stream states furlongs as its unit;
/// `options` are further options of `lsl_play.py`.
pub(super) fn play(
    interpreter: &Path,
    folder: &Path,
    name: &str,
    eeg: &Eeg,
    options: &[&str],
) -> Process {
    let values = eeg.write_values(folder).display().to_string();
    let [rate, samples] = [eeg.rate_hz, SAMPLES].map(|number| number.to_string());
    let labels = eeg.labels.join(",");
    let arguments = [name, &values, &rate, &samples, &labels, "furlongs"];
    python(interpreter, folder, "lsl_play", &[&arguments, options].concat())
}
