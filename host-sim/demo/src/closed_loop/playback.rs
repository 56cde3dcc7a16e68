//! Plays a recording through host-sim and the bridge, and reads the predictions.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use indicatif::ProgressBar;
use model::HOP;
use pipeline::Mains;
use serde_json::Value;
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::time::timeout;

use super::{Options, Prediction, filter_delay_s, mains_hz};
use crate::Failure;
use crate::comparison::seconds;
use crate::program::{BOARD, BRIDGE, Program};

/// Topic of the predictions.
const TOPIC: &str = "/smr/neuroprediction/raw";
/// Time limit for the next line from the bridge, which reports once a second, and for the bridge to
/// exit after the end of the recording.
const SILENCE: Duration = Duration::from_secs(20);

/// A prediction from the bridge, and its latency.
#[derive(Debug, Clone)]
pub struct Received {
    /// Number of the prediction's hop, from 1.
    pub hop: usize,
    /// Decision of the bridge at this hop.
    pub prediction: Prediction,
    /// Time from the hop's last sample to the arrival, milliseconds; means nothing unless the
    /// recording is played in real time.
    pub latency_ms: f64,
}

/// Plays a recording to its end, and advances `bar` with each prediction that arrives. `own` holds
/// the paths of recording and classifier, `programs` is the folder of the programs, and `folder` is
/// for temporary files.
///
/// # Errors
/// A program does not start, fails or does not respond in time.
pub(super) async fn play(
    own: [&Path; 2],
    options: &Options,
    [programs, folder]: [&Path; 2],
    bar: &ProgressBar,
) -> Result<Vec<Received>, Failure> {
    let port = folder.join("board").display().to_string();
    let [recording, classifier] = own.map(|path| path.display().to_string());
    #[rustfmt::skip]
    let arguments = [
        "--port", &port, "--classifier", &classifier, "--prediction-topic", TOPIC, "--streams", "features",
        "--mains", mains_hz(options.mains), "--sink", "ndjson", "--exit-at-end",
        "--config", "/dev/null",
    ];
    let (program, piped) = (programs.join(BRIDGE), Some(Stdio::piped()));
    let mut bridge = Program::start(&program, &arguments, folder, piped)?;
    let lines = bridge.child.stdout.take().ok_or_else(|| bridge.ended())?;
    let mut lines = BufReader::new(lines).lines();
    let port = format!("pty:{port}");
    let pace = if options.fast { "--fast" } else { "--realtime" };
    let arguments = ["run", "--input", &recording, "--output", &port, pace];
    let mut board = Program::start(&programs.join(BOARD), &arguments, folder, None)?;
    let mut received = Vec::new();
    let mut board_ended = false;
    loop {
        tokio::select! {
            line = timeout(SILENCE, lines.next_line()) => match line {
                Ok(Ok(Some(line))) => {
                    if let Some(prediction) = prediction(&line, options.mains) {
                        bar.inc(1);
                        received.push(prediction);
                    }
                }
                Ok(_) => break,
                Err(_) => return Err(bridge.timed_out("the bridge reported nothing", SILENCE)),
            },
            status = board.child.wait(), if !board_ended => {
                if !status.is_ok_and(|status| status.success()) {
                    return Err(board.ended());
                }
                board_ended = true;
            }
        }
    }
    match timeout(SILENCE, bridge.child.wait()).await {
        Ok(Ok(status)) if status.success() && !received.is_empty() => Ok(received),
        _ => Err(bridge.ended()),
    }
}

/// Returns the prediction in a line of the bridge's output; `None` if the line holds another
/// message.
fn prediction(line: &str, mains: Mains) -> Option<Received> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).ok()?;
    let line: Value = serde_json::from_str(line).ok()?;
    if line["topic"] != TOPIC {
        return None;
    }
    let message = &line["message"];
    let header = &message["header"];
    let stamp = &header["stamp"];
    let stamp_s = stamp["secs"].as_f64()? + stamp["nsecs"].as_f64()? * 1e-9;
    // The stamp is the time at which the hop's first step was at the electrodes.
    let delay_s = seconds(HOP - 1) + filter_delay_s(mains);
    let numbers = |field: &str| message[field]["data"].as_array();
    let probabilities = numbers("softpredict")?.iter().filter_map(Value::as_f64);
    let mut chosen = numbers("hardpredict")?.iter();
    #[expect(clippy::cast_possible_truncation, reason = "written as an f32")]
    Some(Received {
        hop: usize::try_from(header["seq"].as_u64()?).ok()?,
        latency_ms: (now.as_secs_f64() - stamp_s - delay_s) * 1e3,
        prediction: Prediction {
            probabilities: probabilities.map(|p| p as f32).collect(),
            class: chosen.position(|chosen| *chosen == 1),
        },
    })
}
