//! Options of the subcommands that check this machine.

use std::path::PathBuf;

use clap::Parser;

use crate::app::port_options::PortOptions;
use crate::app::sink_kind::SinkKind;
use crate::app::stream_options::StreamOptions;

/// List the serial ports of this machine, and say which are Corticode boards.
///
/// A port that cannot be opened has a line with the reason and the command that helps. No port is
/// opened. An ST-LINK `may be` a board: the UART of whatever board it is on.
///
/// Exit status: 0, also without any port.
#[derive(Clone, Debug, Parser)]
#[command(name = "ports")]
pub(crate) struct PortsOptions {
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
    /// Print the udev rule for boards on USB instead
    #[arg(long, conflicts_with = "json")]
    pub(crate) udev_rule: bool,
}

/// Check what the bridge needs: port, device, model, ROS, clock and disk.
///
/// Prints one line for each check, with ok, warning, error or unknown, and a second line with the
/// command that helps. Asks the device to identify itself, and leaves its streams as they are.
/// host-sim on TCP serves one host at a time: the check interrupts a bridge that is connected to it.
///
/// Exit status: 0 no errors, 1 an error.
#[derive(Clone, Debug, Parser)]
#[command(name = "doctor")]
pub(crate) struct DoctorOptions {
    #[command(flatten)]
    pub(crate) at: PortOptions,
    /// Folder of the model to decode with, instead of the built-in one
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    /// Destination of the bridge's frames; with ndjson, ROS is not checked
    #[arg(long, env = "CORTICODE_SINK", value_enum, default_value_t)]
    pub(crate) sink: SinkKind,
    /// ROS master [env: ROS_MASTER_URI] [default: http://localhost:11311/]
    #[arg(long, value_name = "URI")]
    pub(crate) ros_master_uri: Option<String>,
    #[command(flatten)]
    pub(crate) asked: StreamOptions,
    /// Namespace of the bridge's node and topics
    #[arg(
        long,
        env = "CORTICODE_TOPIC_PREFIX",
        default_value = "",
        value_name = "PREFIX"
    )]
    pub(crate) topic_prefix: String,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}
