//! The command line.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, CommandFactory, Error, FromArgMatches, Parser};
use link::{ResetInto, Streams};

use crate::settings::{AnnouncedStream, FillerPolicy, Settings, StampPoint, StreamKind};
use crate::wire::address::PortAddress;

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
pub(crate) struct Options {
    /// Where the device is.
    #[command(flatten)]
    pub(crate) at: PortOptions,
    /// ROS master [env: ROS_MASTER_URI] [default: http://localhost:11311/]
    #[arg(long, value_name = "URI")]
    pub(crate) ros_master_uri: Option<String>,
    /// Where frames go: a ROS master's topics, or lines of JSON on stdout
    #[arg(long, env = "CORTICODE_SINK", value_enum, default_value_t)]
    pub(crate) sink: SinkKind,
    /// Put before the names of the streams, such as /left; /diagnostics keeps its name, and so does
    /// /events/bus
    #[arg(
        long,
        env = "CORTICODE_TOPIC_PREFIX",
        default_value = "",
        value_name = "PREFIX"
    )]
    pub(crate) topic_prefix: String,
    /// Folder of the model to decode with, in place of the built-in one
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    /// What a frame's stamp is the time of
    #[arg(long, env = "CORTICODE_STAMP", value_enum, default_value_t)]
    pub(crate) stamp: StampPoint,
    /// Mains that the device shall remove, Hz; without it the device chooses
    #[arg(long, env = "CORTICODE_MAINS", value_parser = mains)]
    pub(crate) mains: Option<u8>,
    /// What stands in for a lost code, sample or step
    #[arg(long, env = "CORTICODE_FILLER", value_enum, default_value_t)]
    pub(crate) filler: FillerPolicy,
    /// Reconstruct from the newest window alone: 62.5 ms sooner, and about 6 % more error
    #[arg(long, env = "CORTICODE_LOW_LATENCY")]
    pub(crate) low_latency: bool,
    /// What the device streams, comma-separated; codes always. A device that has not all of it is
    /// asked for less
    #[arg(
        long,
        env = "CORTICODE_STREAMS",
        value_enum,
        value_delimiter = ',',
        default_value = "codes,audit,events"
    )]
    pub(crate) streams: Vec<StreamKind>,
    /// Stream that /acquisition/get_info announces; record this one and no other
    #[arg(long, env = "CORTICODE_ANNOUNCE", value_enum, default_value_t)]
    pub(crate) announce: AnnouncedStream,
}

/// Where the device is.
#[derive(Clone, Debug, Args)]
pub(crate) struct PortOptions {
    /// Serial port, pseudoterminal, or tcp:HOST:PORT
    #[arg(long, env = "CORTICODE_PORT", value_name = "PATH|tcp:HOST:PORT")]
    pub(crate) port: PortAddress,
    /// Speed of a serial port; USB and pseudoterminals ignore it
    #[arg(
        long,
        env = "CORTICODE_BAUD",
        default_value_t = 921_600,
        value_parser = clap::value_parser!(u32).range(1..)
    )]
    pub(crate) baud: u32,
}

/// Where frames go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum SinkKind {
    /// ROS 1 topics.
    #[default]
    Ros,
    /// Lines of JSON on stdout.
    Ndjson,
}

impl Options {
    /// What concerns the frames.
    pub(crate) fn settings(&self) -> Settings {
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
    pub(crate) fn topic(&self, name: &str) -> String {
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

/// What the command line asks for.
#[derive(Clone, Debug)]
pub(crate) enum Task {
    /// Without a subcommand: frames from the board.
    Bridge(Box<Options>),
    /// The device tests its converters.
    SelfTest(SelfTestOptions),
    /// The device starts anew.
    Reset(ResetOptions),
}

/// Let the device test its converters with their own signals, and print what it found.
///
/// Ends with 0 if everything is in order, 1 if not, 3 if nothing answers, 4 if the device refuses.
#[derive(Clone, Debug, Parser)]
#[command(name = "selftest")]
pub(crate) struct SelfTestOptions {
    /// Where the device is.
    #[command(flatten)]
    pub(crate) at: PortOptions,
    /// Print JSON in place of the table
    #[arg(long)]
    pub(crate) json: bool,
}

/// Let the device start anew, and say why it says that it did.
///
/// Ends with 0 when it is back (with --bootloader: when it has agreed), 3 if nothing answers, 4 if
/// the device refuses.
#[derive(Clone, Debug, Parser)]
#[command(name = "reset")]
pub(crate) struct ResetOptions {
    /// Where the device is.
    #[command(flatten)]
    pub(crate) at: PortOptions,
    /// Start the microcontroller's own loader, which takes new firmware over USB
    #[arg(long)]
    pub(crate) bootloader: bool,
}

impl ResetOptions {
    /// What the device shall start.
    pub(crate) fn target(&self) -> ResetInto {
        if self.bootloader {
            ResetInto::Bootloader
        } else {
            ResetInto::Firmware
        }
    }
}

impl Task {
    /// What these arguments ask for; the first is the program's name.
    ///
    /// # Errors
    ///
    /// [`Error`], which prints itself: usage, or the help that was asked for.
    pub(crate) fn parse_from(arguments: impl IntoIterator<Item = OsString>) -> Result<Task, Error> {
        let mut command = Options::command()
            .args_conflicts_with_subcommands(true)
            .subcommand_negates_reqs(true)
            .subcommand(SelfTestOptions::command())
            .subcommand(ResetOptions::command());
        let matches = command.try_get_matches_from_mut(arguments)?;
        let task = match matches.subcommand() {
            Some(("selftest", of)) => SelfTestOptions::from_arg_matches(of).map(Task::SelfTest),
            Some((_, of)) => ResetOptions::from_arg_matches(of).map(Task::Reset),
            None => {
                Options::from_arg_matches(&matches).map(|options| Task::Bridge(Box::new(options)))
            }
        };
        task.map_err(|error| error.format(&mut command))
    }
}
