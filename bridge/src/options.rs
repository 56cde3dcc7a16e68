//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser};
use link::Streams;

use crate::{AnnouncedStream, FillerPolicy, PortAddress, Settings, StampPoint, StreamKind};

/// Frames from the board, republished as ROS-Neuro NeuroFrames.
///
/// Publishes /encoded, /neurodata_reconstructed, /events/bus and /diagnostics, on request
/// /neurodata and /neurodata_filtered, and serves /acquisition/get_info, ~start, ~stop and ~quit,
/// as the node `acquisition`. The answer of get_info describes ONE of the streams, /encoded unless
/// --announce says otherwise: a rosneuro_recorder or visualizer that is remapped to another one
/// gets frames that are larger than it allocated for. Waits for a device and for a ROS master that
/// are not there yet, and comes back when they do. ROS's own arguments work too: __name:=, __ns:=,
/// /encoded:=/neurodata. Its log goes to stderr; RUST_LOG=debug shows more.
///
/// Ends with 0, 1 (a check failed), 2 (usage), 3 (device or ROS not reachable) or 4 (the device
/// refuses).
#[derive(Clone, Debug, Parser)]
#[command(name = "corticode-bridge", version)]
pub struct Options {
    /// Where the device is.
    #[command(flatten)]
    pub at: PortOptions,
    /// ROS master [env: ROS_MASTER_URI] [default: http://localhost:11311/]
    #[arg(long, value_name = "URI")]
    pub ros_master_uri: Option<String>,
    /// Where frames go: a ROS master's topics, or lines of JSON on stdout
    #[arg(long, env = "CORTICODE_SINK", value_enum, default_value_t)]
    pub sink: SinkKind,
    /// Put before the names of the streams, such as /left; /diagnostics keeps its name, and so does
    /// /events/bus
    #[arg(
        long,
        env = "CORTICODE_TOPIC_PREFIX",
        default_value = "",
        value_name = "PREFIX"
    )]
    pub topic_prefix: String,
    /// Folder of the model to decode with, in place of the built-in one
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub model: Option<PathBuf>,
    /// What a frame's stamp is the time of
    #[arg(long, env = "CORTICODE_STAMP", value_enum, default_value_t)]
    pub stamp: StampPoint,
    /// Mains that the device shall remove, Hz; without it the device chooses
    #[arg(long, env = "CORTICODE_MAINS", value_parser = mains)]
    pub mains: Option<u8>,
    /// What stands in for a lost code, sample or step
    #[arg(long, env = "CORTICODE_FILLER", value_enum, default_value_t)]
    pub filler: FillerPolicy,
    /// Reconstruct from the newest window alone: 62.5 ms sooner, and about 6 % more error
    #[arg(long, env = "CORTICODE_LOW_LATENCY")]
    pub low_latency: bool,
    /// What the device streams, comma-separated; codes always. A device that has not all of it is
    /// asked for less
    #[arg(
        long,
        env = "CORTICODE_STREAMS",
        value_enum,
        value_delimiter = ',',
        default_value = "codes,audit,events"
    )]
    pub streams: Vec<StreamKind>,
    /// Stream that /acquisition/get_info announces; record this one and no other
    #[arg(long, env = "CORTICODE_ANNOUNCE", value_enum, default_value_t)]
    pub announce: AnnouncedStream,
}

/// Where the device is.
#[derive(Clone, Debug, Args)]
pub struct PortOptions {
    /// Serial port, pseudoterminal, or tcp:HOST:PORT
    #[arg(long, env = "CORTICODE_PORT", value_name = "PATH|tcp:HOST:PORT")]
    pub port: PortAddress,
    /// Speed of a serial port; USB and pseudoterminals ignore it
    #[arg(
        long,
        env = "CORTICODE_BAUD",
        default_value_t = 921_600,
        value_parser = clap::value_parser!(u32).range(1..)
    )]
    pub baud: u32,
}

/// Where frames go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum SinkKind {
    /// ROS 1 topics.
    #[default]
    Ros,
    /// Lines of JSON on stdout.
    Ndjson,
}

impl Options {
    /// What concerns the frames.
    pub fn settings(&self) -> Settings {
        Settings {
            stamp: self.stamp,
            mains_hz: self.mains.unwrap_or(0),
            filler: self.filler,
            low_latency: self.low_latency,
            announced: self.announce,
            streams: self
                .streams
                .iter()
                .fold(Streams::CODES, |streams, kind| streams | kind.bit()),
        }
    }

    /// Full name of a stream's topic.
    pub fn topic(&self, name: &str) -> String {
        format!("{}/{name}", self.topic_prefix.trim_end_matches('/'))
    }
}

fn mains(text: &str) -> Result<u8, String> {
    match text {
        "50" => Ok(50),
        "60" => Ok(60),
        _ => Err("mains are 50 or 60 Hz".to_owned()),
    }
}
