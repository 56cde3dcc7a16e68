//! Command-line options and subcommands.

use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::PathBuf;

use artifact::ErrorWeight;
use bridge_core::{
    AnnouncedStream, Choice, EventStamps, Exclusions, FillerPolicy, RawForm, Settings, StampPoint,
    StreamKind, with_codes,
};
use clap::builder::{
    BoolishValueParser, PossibleValue, PossibleValuesParser, Resettable, TypedValueParser,
};
use clap::{
    Arg, ArgAction, Args, Command, CommandFactory, Error, FromArgMatches, Parser, Subcommand,
    ValueHint,
};
use link::{MAX_RATE, ResetInto, Streams};
use view::Token;

use crate::app::classifying::{ClassifierOptions, PredictionOptions};
use crate::app::convert::ConvertOptions;
use crate::app::impedance::ImpedanceOptions;
use crate::app::manual::{CompletionsOptions, ManOptions};
use crate::app::master::MasterOptions;
use crate::app::replay::ReplayOptions;
use crate::app::update::UpdateOptions;
use crate::error::BridgeError;
use crate::realtime::RealtimeOption;
use crate::subject_models::{SubjectModels, subject_name};
use crate::wire::port::PortAddress;

/// Identifier and long name of the option `--config`, which names the configuration file.
pub(crate) const CONFIG: &str = "config";

/// Headings under which `--help` groups the options.
const DEVICE: &str = "Device";
const OUTPUTS: &str = "Outputs";
const DECODING: &str = "Decoding and time";

/// Publish the codes and signals of a Corticode board as ROS-Neuro NeuroFrames.
///
/// Publishes /encoded, /neurodata_reconstructed, /events/bus and /diagnostics, on request also
/// /neurodata and /neurodata_corticode, and serves /acquisition/get_info, ~start, ~stop and ~quit,
/// as the node `acquisition`. The answer of get_info describes ONE of the streams, /encoded unless
/// --announce selects another or codes do not stream: a rosneuro_recorder or visualizer that is
/// remapped to another stream receives frames that are larger than it allocated. Waits for an
/// absent device or ROS master and reconnects when it returns. ROS's own arguments work too:
/// __name:=, __ns:=, /encoded:=/neurodata, and --ros-args -r __node:=NAME -p port:=/dev/ttyACM0.
/// Each option is a private parameter as well: _port:=/dev/ttyACM0, or ~port on the parameter
/// server, which flags and environment override. --config names a file of options, which all of
/// these override. The log goes to stderr; RUST_LOG=debug shows more.
///
/// Exit status: 0 done, 1 a check failed, 2 wrong usage, 3 device or ROS not reachable, 4 the
/// device refuses.
#[derive(Clone, Debug, Parser)]
#[command(name = "corticode-bridge", version)]
pub(crate) struct Options {
    #[command(flatten)]
    pub(crate) at: PortOptions,
    #[command(flatten)]
    pub(crate) ros: RosOptions,
    #[command(flatten)]
    pub(crate) ros2: Ros2Options,
    #[command(flatten)]
    pub(crate) viewing: ViewOptions,
    #[command(flatten)]
    pub(crate) lsl: LslOptions,
    /// Folder of the model to decode with, instead of the built-in one
    #[arg(long, help_heading = DECODING, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) person: PersonOptions,
    /// What the stamp of a frame refers to
    #[arg(long, help_heading = DECODING, env = "CORTICODE_STAMP", default_value = "first", value_parser = choice::<StampPoint>())]
    pub(crate) stamp: StampPoint,
    #[command(flatten)]
    pub(crate) asked: StreamOptions,
    #[command(flatten)]
    pub(crate) predicting: PredictionOptions,
    /// Replacement of a lost code, packed block, sample or step
    #[arg(long, help_heading = DECODING, env = "CORTICODE_FILLER", default_value = "last", value_parser = choice::<FillerPolicy>())]
    pub(crate) filler: FillerPolicy,
    /// Reconstruct from the newest window or packed block alone: 62.5 ms earlier, with a slightly
    /// larger error
    #[arg(long, help_heading = DECODING, env = "CORTICODE_LOW_LATENCY", switch())]
    pub(crate) low_latency: bool,
    /// Time in the stamp of an event: either, for each rosneuro_recorder, the time that places the
    /// event correctly in this recorder's file of the announced stream, or the time of the event
    /// itself
    #[arg(long, help_heading = OUTPUTS, env = "CORTICODE_EVENT_STAMPS", default_value = "recorder", value_parser = choice::<EventStamps>())]
    pub(crate) event_stamps: EventStamps,
    /// End with status 0 when a port that has sent frames closes, after everything is published:
    /// for scripts that play a recording, such as with host-sim run --input FILE. Messages that a
    /// ROS subscriber has not received after 0.5 s are lost. Without this option, the bridge waits
    /// for the port to return
    #[arg(long, help_heading = DEVICE, env = "CORTICODE_EXIT_AT_END", switch())]
    pub(crate) exit_at_end: bool,
    #[command(flatten, next_help_heading = DEVICE)]
    pub(crate) realtime: RealtimeOption,
    /// Stream that /acquisition/get_info describes; record this one and no other [default: encoded,
    /// or reconstructed if codes do not stream]
    #[arg(long, help_heading = OUTPUTS, env = "CORTICODE_ANNOUNCE", value_parser = choice::<AnnouncedStream>())]
    pub(crate) announce: Option<AnnouncedStream>,
}

impl Options {
    /// Returns the names of the node's private ROS parameters that set options. `ros_master_uri` is
    /// not among them, because the parameters are read from that master.
    pub(crate) fn parameter_names() -> Vec<String> {
        let command = Options::command();
        let options = command.get_arguments();
        let ids = options.map(|option| option.get_id().as_str());
        let ids = ids.filter(|id| *id != "ros_master_uri");
        ids.map(str::to_owned).collect()
    }

    /// Returns the settings that these options describe, for `bridge_core::Core`.
    pub(crate) fn settings(&self) -> Settings {
        let streams = self.asked.streams();
        let default = if streams.contains(Streams::CODES) {
            AnnouncedStream::Encoded
        } else {
            AnnouncedStream::Reconstructed
        };
        Settings {
            stamp: self.stamp,
            mains_hz: self.asked.mains.unwrap_or(0),
            filler: self.filler,
            low_latency: self.low_latency,
            announced: self.announce.unwrap_or(default),
            event_stamps: self.event_stamps,
            streams,
            packed_rate: self.asked.packed_rate,
        }
    }
}

/// Options that select a model fitted to the person who wears the cap.
#[derive(Args, Clone, Debug)]
pub struct PersonOptions {
    /// Upload the model in this folder, fitted to the person who wears the cap, to the device,
    /// which uses it instead of its built-in model; the bridge decodes with it too. It goes to the
    /// device's RAM before each run, if the device has another one. Of the boards, only the
    /// NUCLEO-H743ZI2 has room for it. Overrides --model
    #[arg(long, help_heading = DECODING, env = "CORTICODE_UPLOAD_MODEL", value_name = "FOLDER")]
    upload_model: Option<PathBuf>,
    /// Like --upload-model, with the newest model that `corticode-bridge calibrate` has fitted to
    /// this person. Overrides --model; --upload-model overrides this option
    #[arg(long, help_heading = DECODING, env = "CORTICODE_SUBJECT", value_name = "NAME", value_parser = subject_name)]
    subject: Option<String>,
}

impl PersonOptions {
    /// Returns the folder of the person's model; `None` if the options name none.
    ///
    /// # Errors
    ///
    /// [`BridgeError`] if no model was fitted to the subject, or the models' folder cannot be read.
    pub fn folder(self) -> Result<Option<PathBuf>, BridgeError> {
        let (None, Some(subject)) = (&self.upload_model, &self.subject) else {
            return Ok(self.upload_model);
        };
        let models = SubjectModels::of_user(|name| std::env::var_os(name))?;
        let folder = models.newest(subject)?;
        tracing::info!("model of {subject}: {}", folder.display());
        Ok(Some(folder))
    }
}

/// Options that say which electrodes are excluded from the codes and filled from the others.
#[derive(Args, Clone, Debug)]
pub struct ExclusionOptions {
    /// Electrodes that the device always excludes from its codes and fills from the others, such as
    /// Fp1,Fp2
    #[arg(long, help_heading = DEVICE, env = "CORTICODE_EXCLUDE", value_name = "LABELS", value_delimiter = ',')]
    pub(crate) exclude: Vec<String>,
    /// Electrodes that the device never excludes, even if it finds them bad
    #[arg(long, help_heading = DEVICE, env = "CORTICODE_NEVER_EXCLUDE", value_name = "LABELS", value_delimiter = ',')]
    pub(crate) never_exclude: Vec<String>,
    /// Whether the device excludes electrodes that it finds bad: at the rail, flat, with mains or
    /// noise, or unlike what the others predict
    #[arg(
        long,
        help_heading = DEVICE,
        env = "CORTICODE_FIND_BAD",
        action = ArgAction::Set,
        default_value = "true",
        value_parser = BoolishValueParser::new()
    )]
    pub(crate) find_bad: bool,
}

impl ExclusionOptions {
    /// Returns the exclusions that these options describe, for `bridge_core::Core`.
    pub fn exclusions(&self) -> Exclusions {
        Exclusions {
            always: self.exclude.clone(),
            never: self.never_exclude.clone(),
            automatic: self.find_bad,
        }
    }
}

/// Options that say whether the device measures the impedance of the electrodes while it streams.
#[derive(Args, Clone, Debug)]
pub(crate) struct ContactOptions {
    /// Measure the impedance of every electrode while the device streams: once a second on
    /// /diagnostics. Raw samples then have a tone at a quarter of the sample rate. Needs 500 Hz or
    /// more
    #[arg(long, help_heading = DEVICE, env = "CORTICODE_IMPEDANCE", switch())]
    impedance: bool,
    /// Resistance on the board in series with each electrode, ohms, subtracted from the impedances
    #[arg(long, help_heading = DEVICE, env = "CORTICODE_SERIES_OHMS", value_name = "OHMS", default_value_t = 0)]
    series_ohms: u32,
}

impl ContactOptions {
    /// Returns the resistance in series with each electrode, ohms; `None` to measure no impedance.
    pub(crate) fn impedance(&self) -> Option<u32> {
        self.impedance.then_some(self.series_ohms)
    }
}

// The subcommand, which says what the program shall do. This is no doc comment, because clap would
// show it in place of the description of `Options`.
#[derive(Clone, Debug, Subcommand)]
pub(crate) enum Task {
    // Stream until shutdown; the default without a subcommand.
    #[command(skip)]
    Bridge(Box<Options>),
    #[command(name = "selftest")]
    SelfTest(SelfTestOptions),
    Reset(ResetOptions),
    Update(UpdateOptions),
    Record(RecordOptions),
    Replay(ReplayOptions),
    Ports(PortsOptions),
    Doctor(DoctorOptions),
    Convert(ConvertOptions),
    Calibrate(Box<CalibrateOptions>),
    Impedance(ImpedanceOptions),
    Master(MasterOptions),
    Completions(CompletionsOptions),
    Man(ManOptions),
}

/// Test the device's converters with their internal signals, and print the results.
///
/// Exit status: 0 everything in order, 1 a fault was found, 3 no answer, 4 the device refuses.
#[derive(Args, Clone, Debug)]
pub(crate) struct SelfTestOptions {
    #[command(flatten)]
    pub(crate) at: PortOptions,
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
}

/// Restart the device, and print the cause of the restart that the device reports.
///
/// Exit status: 0 the device has restarted (with --bootloader: has agreed to), 3 no answer, 4 the
/// device refuses.
#[derive(Args, Clone, Debug)]
pub(crate) struct ResetOptions {
    #[command(flatten)]
    pub(crate) at: PortOptions,
    /// Start the microcontroller's built-in bootloader, which accepts firmware over USB
    #[arg(long)]
    pub(crate) bootloader: bool,
}

impl ResetOptions {
    pub(crate) fn target(&self) -> ResetInto {
        if self.bootloader { ResetInto::Bootloader } else { ResetInto::Firmware }
    }
}

/// Record everything that a device sends, byte for byte, with the times at which the bytes were
/// read.
///
/// Asks the device for its streams as the bridge does, waits for an absent device and reconnects
/// when it returns. Needs no ROS and decodes nothing. Ends on Ctrl-C or SIGTERM; a file that was
/// not ended, because of kill -9 or an empty battery, is readable to its last whole frame. `replay`
/// plays the file as a device, and `convert` writes it as GDF, BDF, CSV or NPZ. An existing file is
/// replaced only with --force.
///
/// Exit status: 0 done, 1 the file cannot be written any further, 2 wrong usage or an existing
/// file.
#[derive(Args, Clone, Debug)]
pub(crate) struct RecordOptions {
    /// File to write; it must not exist, except with --force
    pub(crate) file: PathBuf,
    /// Replace FILE if it exists
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    pub(crate) at: PortOptions,
    #[command(flatten)]
    pub(crate) asked: StreamOptions,
}

/// Fit a packed model to the person who wears the cap, from two minutes of their EEG.
///
/// Asks the device whether it takes a packed model, listens to its filtered signal, and shows the
/// quality of each electrode meanwhile. Seconds in which steps are missing or more than a quarter
/// of the electrodes is bad do not count; fewer bad electrodes are interpolated. Then fits a model,
/// which takes some seconds, and compares the model with the built-in one on a part of the signal
/// that was not used for the fit. Writes the model to a folder, and uploads it to the device, which
/// uses it until the device restarts. The bridge uses the model with --subject NAME. With
/// --recording, no device is needed. Ctrl-C before the model is written leaves device and folder as
/// they were.
///
/// Exit status: 0 done, 1 interrupted, 2 wrong usage, too little good signal or an existing folder,
/// 4 the device takes no packed model, or refuses this model, whose folder remains.
#[derive(Args, Clone, Debug)]
pub(crate) struct CalibrateOptions {
    /// Name of the person, under which the model is stored
    #[arg(long, env = "CORTICODE_SUBJECT", value_name = "NAME", value_parser = subject_name)]
    pub(crate) subject: String,
    /// Recordings to fit the model to, in place of the device's signal: EDF, BDF or GDF
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "mains")]
    pub(crate) recording: Vec<PathBuf>,
    /// Seconds of good signal to fit the model to; of recordings, the first ones
    #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u32).range(20..=3600))]
    pub(crate) seconds: u32,
    /// Fit the values of /encoded too: a linear code of the person, which replaces the network's
    /// code
    #[arg(long)]
    pub(crate) numbers: bool,
    /// Use of the signals decoded from packed blocks: `motor` gives more weight to errors at 8 to
    /// 30 Hz that a decoder sees through spatial filters, and a band such as 8..13 to such errors
    /// in that band [default: viewing, without weights]
    #[arg(long = "for", value_name = "USE", value_parser = packed_fit::weight_for)]
    pub(crate) weight: Option<ErrorWeight>,
    /// Folder to write the model to, which must not exist [default:
    /// ~/.local/share/corticode/models/SUBJECT/DATE]
    #[arg(long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
    /// Folder of the device's model, if the device has another model than this program's built-in
    /// one; the new model gets the montage, filters and network of the device's model
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    /// Mains frequency that the filters shall remove, Hz; the device chooses by default
    #[arg(long, env = "CORTICODE_MAINS", value_parser = mains)]
    pub(crate) mains: Option<u8>,
    #[command(flatten)]
    pub(crate) at: PortOptions,
}

impl Task {
    /// Parses the arguments; the first one is the program's name.
    ///
    /// # Errors
    ///
    /// [`Error`] for wrong usage or a request for help; [`Error::exit`] prints it.
    pub(crate) fn parse_from(arguments: impl IntoIterator<Item = OsString>) -> Result<Task, Error> {
        let mut command = command();
        let matches = command.try_get_matches_from_mut(arguments)?;
        let task = if matches.subcommand().is_some() {
            Task::from_arg_matches(&matches)
        } else {
            Options::from_arg_matches(&matches).map(|options| Task::Bridge(Box::new(options)))
        };
        task.map_err(|error| error.format(&mut command))
    }
}

/// Returns the command line with all subcommands. Empty environment variables set no option.
pub(crate) fn command() -> Command {
    let command = all_options().mut_args(ignore_empty_variable);
    command.mut_subcommands(|subcommand| subcommand.mut_args(ignore_empty_variable))
}

/// Returns `option`, without its environment variable if that variable is empty.
pub fn ignore_empty_variable(option: Arg) -> Arg {
    let value = option.get_env().and_then(std::env::var_os);
    match value {
        Some(value) if value.is_empty() => option.env(Resettable::Reset),
        _ => option,
    }
}

fn all_options() -> Command {
    let without_config = ["replay", "ports", "master", "completions", "man"];
    let command = Options::command()
        .arg(config_option())
        .args_conflicts_with_subcommands(true)
        .subcommand_negates_reqs(true);
    Task::augment_subcommands(command).mut_subcommands(|subcommand| {
        if without_config.contains(&subcommand.get_name()) {
            subcommand
        } else {
            subcommand.arg(config_option())
        }
    })
}

/// Option that names the configuration file. It has no field in the structs of options, because the
/// file is read before these are parsed.
fn config_option() -> Arg {
    Arg::new(CONFIG)
        .long(CONFIG)
        .env("CORTICODE_CONFIG")
        .value_name("FILE")
        .value_hint(ValueHint::FilePath)
        .value_parser(clap::value_parser!(PathBuf))
        .help(
            "TOML file with options, such as port = \"/dev/ttyACM0\" [default: \
             ~/.config/corticode/bridge.toml, else /etc/corticode/bridge.toml, if one exists]",
        )
}

/// List the serial ports of this machine, and say which are Corticode boards.
///
/// A port that cannot be opened has a line with the reason and the command that helps. No port is
/// opened. An ST-LINK `may be` a board: it leads to the UART of the board that it is mounted on.
///
/// Exit status: 0, also without any port.
#[derive(Args, Clone, Debug)]
pub(crate) struct PortsOptions {
    /// Print JSON instead of a table
    #[arg(long)]
    pub(crate) json: bool,
    /// Print the udev rule for boards on USB, and make no checks
    #[arg(long, conflicts_with = "json")]
    pub(crate) udev_rule: bool,
}

/// Check what the bridge needs: port, device, model, ROS, LSL, clock, disk, real-time priority.
///
/// Prints one line for each check, with ok, warning, error or unknown, and a second line with the
/// command that helps. Asks the device to identify itself, and leaves its streams as they are.
/// Checks ROS and LSL only if --sink includes them. host-sim on TCP serves one host at a time: the
/// check interrupts a bridge that is connected to it.
///
/// Exit status: 0 no errors, 1 an error.
#[derive(Args, Clone, Debug)]
pub(crate) struct DoctorOptions {
    #[command(flatten)]
    pub(crate) at: PortOptions,
    /// Folder of the model to decode with, instead of the built-in one
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) ros: RosOptions,
    #[command(flatten)]
    pub(crate) lsl: LslOptions,
    #[command(flatten)]
    pub(crate) ros2: Ros2Options,
    #[command(flatten)]
    pub(crate) asked: StreamOptions,
    #[command(flatten)]
    pub(crate) realtime: RealtimeOption,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

/// Options of the bridge and of `doctor` that set where frames go and how topics are named.
#[derive(Clone, Debug, Args)]
pub(crate) struct RosOptions {
    /// ROS master [env: ROS_MASTER_URI] [default: http://localhost:11311/]
    #[arg(long, help_heading = OUTPUTS, value_name = "URI")]
    pub(crate) ros_master_uri: Option<String>,
    /// Outlets for what is published, comma-separated; each has its own queues, so none delays
    /// another
    #[arg(
        long,
        help_heading = OUTPUTS,
        env = "CORTICODE_SINK",
        value_enum,
        value_delimiter = ',',
        default_value = "ros"
    )]
    pub(crate) sink: Vec<SinkKind>,
    /// Namespace of the node, its topics and services, such as /left for /left/encoded and
    /// /left/acquisition/get_info; /diagnostics keeps its name
    #[arg(
        long,
        help_heading = OUTPUTS,
        env = "CORTICODE_TOPIC_PREFIX",
        default_value = "",
        value_name = "PREFIX"
    )]
    pub(crate) topic_prefix: String,
}

/// Options of the bridge, `record` and `doctor` that set what the device is asked to send.
#[derive(Clone, Debug, Args)]
pub(crate) struct StreamOptions {
    /// Mains frequency that the device shall remove, Hz; the device chooses by default
    #[arg(long, help_heading = DEVICE, env = "CORTICODE_MAINS", value_parser = mains)]
    pub(crate) mains: Option<u8>,
    /// Streams of the device, comma-separated; codes are included unless packed or features is
    /// named. If the device refuses some streams, it is asked for fewer
    #[arg(
        long,
        help_heading = DEVICE,
        env = "CORTICODE_STREAMS",
        value_parser = choice::<StreamKind>(),
        value_delimiter = ',',
        default_value = "codes,audit,events"
    )]
    pub(crate) streams: Vec<StreamKind>,
    /// Rate of the packed code, 0 to 15; each higher rate is 3 dB coarser; by default the model's
    #[arg(long, help_heading = DEVICE, env = "CORTICODE_PACKED_RATE", value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_RATE)))]
    pub(crate) packed_rate: Option<u8>,
    /// Form in which the device sends the samples of the stream raw; all forms yield the same
    /// frames
    #[arg(long, help_heading = DEVICE, env = "CORTICODE_RAW_FORM", default_value = "any", value_parser = choice::<RawForm>())]
    pub(crate) raw_form: RawForm,
    #[command(flatten)]
    pub(crate) exclusion: ExclusionOptions,
    #[command(flatten)]
    pub(crate) contacts: ContactOptions,
    #[command(flatten)]
    pub(crate) classifying: ClassifierOptions,
}

impl StreamOptions {
    /// Logs a warning if `--packed-rate` is set but has no effect on the chosen streams.
    pub(crate) fn warn_about_unused(&self) {
        if self.packed_rate.is_some() && !self.streams().contains(Streams::PACKED) {
            tracing::warn!(
                "--packed-rate has no effect, because packed is not among the streams; add it with --streams packed"
            );
        }
    }

    /// Returns the streams to ask for. They include codes, unless packed blocks or features are
    /// named.
    pub(crate) fn streams(&self) -> Streams {
        let asked = self.streams.iter();
        let streams = with_codes(asked.fold(Streams::empty(), |streams, kind| match kind {
            StreamKind::Raw => streams | self.raw_form.streams(),
            kind => streams | kind.bit(),
        }));
        self.classifying.streams(streams)
    }
}

fn mains(text: &str) -> Result<u8, String> {
    match text {
        "50" => Ok(50),
        "60" => Ok(60),
        _ => Err("the mains frequency is 50 or 60 Hz".to_owned()),
    }
}

/// Options of the bridge and its subcommands that set address and speed of the port.
#[derive(Clone, Debug, Args)]
pub(crate) struct PortOptions {
    /// Serial port, pseudoterminal, tcp:HOST:PORT, or auto: the only board on USB, or the one with
    /// a serial number, auto:SERIAL. The board is found again after it was unplugged; `ports` lists
    /// all
    #[arg(
        long,
        help_heading = DEVICE,
        env = "CORTICODE_PORT",
        value_name = "PATH|tcp:HOST:PORT|auto",
        default_value = "auto"
    )]
    pub(crate) port: PortAddress,
    /// Baud rate of a serial port; USB and pseudoterminals ignore it
    #[arg(
        long,
        help_heading = DEVICE,
        env = "CORTICODE_BAUD",
        default_value_t = 921_600,
        value_parser = clap::value_parser!(u32).range(1..)
    )]
    pub(crate) baud: u32,
}

/// Outlets: where the bridge publishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum SinkKind {
    /// ROS 1 topics.
    #[value(alias = "ros1")]
    Ros,
    /// ROS 2 topics, in the domain of --ros-domain-id.
    Ros2,
    /// Lines of JSON on stdout.
    Ndjson,
    /// A live page for a browser; the page's address is printed.
    View,
    /// Streams of the Lab Streaming Layer.
    Lsl,
}

impl SinkKind {
    /// Returns the name of the outlet, as in `--sink`.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            SinkKind::Ros => "ros",
            SinkKind::Ros2 => "ros2",
            SinkKind::Ndjson => "ndjson",
            SinkKind::View => "view",
            SinkKind::Lsl => "lsl",
        }
    }
}

/// Options of the Lab Streaming Layer.
#[derive(Args, Clone, Debug)]
pub(crate) struct LslOptions {
    /// File of liblsl, the library of the Lab Streaming Layer [default: the system's, else that of
    /// the Python package pylsl]
    #[arg(long, help_heading = OUTPUTS, env = "PYLSL_LIB", value_name = "FILE")]
    pub(crate) liblsl: Option<PathBuf>,
    /// First part of the names of the streams of --sink lsl, such as corticode-raw; give each of
    /// several bridges its own
    #[arg(long, help_heading = OUTPUTS, env = "CORTICODE_LSL_NAME", value_name = "NAME", default_value = "corticode")]
    pub(crate) lsl_name: String,
}

/// Options of the ROS 2 outlet, which the bridge and `doctor` have in common.
#[derive(Args, Clone, Debug)]
pub(crate) struct Ros2Options {
    /// Domain of the ROS 2 node, which finds only nodes of the same domain
    #[arg(
        long,
        help_heading = OUTPUTS,
        env = "ROS_DOMAIN_ID",
        value_name = "ID",
        default_value_t = 0,
        value_parser = clap::value_parser!(u8).range(0..=232)
    )]
    pub(crate) ros_domain_id: u8,
    /// Delivery of frames in ROS 2: `reliable` sends lost packets again; `sensor-data`, which is
    /// best effort, does not, and reaches no subscriber that asks for reliable
    #[arg(
        long,
        help_heading = OUTPUTS,
        env = "CORTICODE_ROS2_QOS",
        value_enum,
        default_value = "reliable"
    )]
    pub(crate) ros2_qos: Ros2Qos,
}

/// Quality of service with which frames are sent in ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Ros2Qos {
    Reliable,
    SensorData,
}

/// Options of the live page.
#[derive(Args, Clone, Debug)]
pub struct ViewOptions {
    /// Address and port of the live page; an address that other machines can reach needs the token
    #[arg(
        long,
        help_heading = OUTPUTS,
        env = "CORTICODE_VIEW_ADDRESS",
        value_name = "IP:PORT",
        default_value = "127.0.0.1:8061"
    )]
    pub(crate) view_address: SocketAddr,
    /// Token of the live page, 16 to 128 letters, digits, - and _; by default a new one
    /// is printed after each start
    #[arg(long, help_heading = OUTPUTS, env = "CORTICODE_VIEW_TOKEN", hide_env_values = true)]
    pub(crate) view_token: Option<Token>,
    /// Folder for the recordings that the live page starts; each is named after its start time
    #[arg(long, help_heading = OUTPUTS, env = "CORTICODE_RECORD_DIR", value_name = "FOLDER", default_value = ".")]
    pub record_dir: PathBuf,
    /// Open the live page in the desktop's browser
    #[arg(long, help_heading = OUTPUTS, env = "CORTICODE_OPEN_BROWSER", switch())]
    pub(crate) open_browser: bool,
}

/// Options that are on or off.
pub trait Switch {
    /// Makes the option a switch that is off by default: `--option` means `--option=true`. An
    /// environment variable and a private ROS parameter can also set it to `false`.
    #[must_use]
    fn switch(self) -> Self;
}

impl Switch for Arg {
    fn switch(self) -> Self {
        self.action(ArgAction::Set)
            .num_args(0..=1)
            .require_equals(true)
            .default_value("false")
            .default_missing_value("true")
            .value_parser(BoolishValueParser::new())
    }
}

/// Returns a parser that accepts the names of the choices of `T` and describes them in `--help`.
pub fn choice<T: Choice>() -> impl TypedValueParser<Value = T> {
    let values = T::CHOICES.iter().map(|(name, help, _)| {
        let help = help.strip_suffix('.').unwrap_or(help);
        PossibleValue::new(*name).help(help)
    });
    PossibleValuesParser::new(values).try_map(|name| {
        let mut choices = T::CHOICES.iter();
        let found = choices.find(|(known, _, _)| *known == name);
        found.map(|(_, _, value)| *value).ok_or("unknown value")
    })
}
