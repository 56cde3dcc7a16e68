//! Command-line options, which can also be set as private ROS parameters.

use std::path::PathBuf;

use bridge::{
    ClassifierOptions, ExclusionOptions, PersonOptions, PredictionOptions, RealtimeOption,
    Switch as _, ViewOptions, choice,
};
use bridge_core::{AnnouncedStream, EventStamps, FillerPolicy, Settings, StampPoint};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, CommandFactory, Parser};
use lsl::InletOptions;
use pipeline::Mains;

use crate::encoder_device::CODES;

/// Encode the EEG of any ROS-Neuro acquisition and publish its codes.
///
/// Subscribes to /neurodata (rosneuro_msgs/NeuroFrame): float microvolts, any frame size, 128 Hz or
/// more, electrodes by label; or, with --source lsl:NAME, to the stream of any amplifier that
/// streams to the Lab Streaming Layer. Publishes /encoded, /neurodata_reconstructed and
/// /diagnostics as corticode-bridge does for a board, and serves ~get_info, ~start, ~stop and
/// ~quit, as the node `corticode`. A recorder of /encoded needs the remapping
/// /acquisition/get_info:=/corticode/get_info. Waits for an absent ROS master or acquisition. ROS's
/// own arguments work too: __name:=, __ns:=, /neurodata:=/filtered. Each option but the master and
/// the level of the log is a private parameter as well: _mains:=60, or ~mains on the parameter
/// server, which flags and environment override. The log goes to stderr.
///
/// Exit status: 0 done, 1 publishing failed, 2 wrong usage, 3 ROS not reachable.
#[derive(Clone, Debug, Parser)]
#[command(name = "corticode-node", version)]
pub(crate) struct Options {
    /// ROS master [env: ROS_MASTER_URI] [default: http://localhost:11311/]
    #[arg(long, value_name = "URI")]
    pub(crate) ros_master_uri: Option<String>,
    /// Namespace of the node, its topics and services, such as /left for /left/neurodata and
    /// /left/encoded; /diagnostics keeps its name
    #[arg(long, env = "CORTICODE_TOPIC_PREFIX", default_value = "", value_name = "PREFIX")]
    pub(crate) topic_prefix: String,
    /// Source of the EEG: `ros`, the topic /neurodata, or `lsl:NAME`, a stream of the Lab Streaming
    /// Layer; lsl:type=EEG, lsl:source_id=ID and lsl:hostname=HOST find it by another property
    #[arg(long, env = "CORTICODE_SOURCE", value_name = "ros|lsl:NAME", default_value = "ros", value_parser = source)]
    pub(crate) source: SourceKind,
    #[command(flatten)]
    pub(crate) stream: StreamOptions,
    /// Mains frequency that the notch filter removes, Hz
    #[arg(
        long,
        env = "CORTICODE_MAINS",
        default_value = "50",
        value_parser = PossibleValuesParser::new(["50", "60"]).map(|hz| if hz == "60" { 60_u8 } else { 50 })
    )]
    pub(crate) mains: u8,
    /// Point of a frame that its stamp refers to
    #[arg(long, env = "CORTICODE_STAMP", default_value = "first", value_parser = choice::<StampPoint>())]
    pub(crate) stamp: StampPoint,
    #[command(flatten)]
    pub(crate) exclusion: ExclusionOptions,
    #[command(flatten)]
    pub(crate) classifying: ClassifierOptions,
    #[command(flatten)]
    pub(crate) predicting: PredictionOptions,
    /// Replacement of a lost code
    #[arg(long, env = "CORTICODE_FILLER", default_value = "last", value_parser = choice::<FillerPolicy>())]
    pub(crate) filler: FillerPolicy,
    /// Reconstruct from the newest window alone: one hop earlier, with a slightly larger error
    #[arg(long, env = "CORTICODE_LOW_LATENCY", switch())]
    pub(crate) low_latency: bool,
    #[command(flatten)]
    pub(crate) realtime: RealtimeOption,
    /// Stream that ~get_info describes; the only stream to record
    #[arg(
        long,
        env = "CORTICODE_ANNOUNCE",
        default_value = "encoded",
        value_parser = PossibleValuesParser::new(["encoded", "reconstructed"]).map(|name| announced(&name))
    )]
    pub(crate) announce: AnnouncedStream,
    /// Folder of the model to decode with; it must be the model that this program was built with
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) person: PersonOptions,
    /// Outlets, comma-separated: ros publishes topics, which the node always does; view also serves
    /// a live page for a browser
    #[arg(
        long,
        env = "CORTICODE_SINK",
        default_value = "ros",
        value_delimiter = ',',
        value_parser = PossibleValuesParser::new(["ros", "view"])
    )]
    pub(crate) sink: Vec<String>,
    #[command(flatten)]
    pub(crate) viewing: ViewOptions,
    /// Log warnings and errors only
    #[arg(short, long, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Log every gap and command as well
    #[arg(short, long)]
    pub(crate) verbose: bool,
}

/// Where the acquisition's frames come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum SourceKind {
    /// The topic /neurodata.
    Ros,
    /// The stream of the Lab Streaming Layer with this property and value.
    Lsl([String; 2]),
}

fn source(text: &str) -> Result<SourceKind, String> {
    match text.split_once(':') {
        None if text == "ros" => Ok(SourceKind::Ros),
        Some(("lsl", query)) => Ok(SourceKind::Lsl(InletOptions::parse_query(query)?)),
        _ => Err("the source is ros, or lsl:NAME".to_owned()),
    }
}

/// Options that replace what a stream of the Lab Streaming Layer states about itself.
#[derive(Args, Clone, Debug)]
pub(crate) struct StreamOptions {
    /// With --source lsl, labels of all channels of the stream, such as Fp1,Fp2; they replace its
    /// own labels
    #[arg(long, env = "CORTICODE_SOURCE_LABELS", value_name = "LABELS", value_delimiter = ',')]
    source_labels: Vec<String>,
    /// With --source lsl, unit of the samples, which replaces the stream's own
    #[arg(long, env = "CORTICODE_SOURCE_UNIT", value_parser = ["microvolts", "millivolts", "volts"])]
    source_unit: Option<String>,
    /// With --source lsl, sampling rate that replaces the stream's own, Hz
    #[arg(long, env = "CORTICODE_SOURCE_RATE", value_name = "HZ")]
    source_rate: Option<u16>,
    /// File of liblsl, the library of the Lab Streaming Layer [default: the system's, else that of
    /// the Python package pylsl]
    #[arg(long, env = "PYLSL_LIB", value_name = "FILE")]
    pub(crate) liblsl: Option<PathBuf>,
}

impl StreamOptions {
    /// Returns the options for receiving the stream that `query` describes.
    pub(crate) fn inlet(&self, query: [String; 2]) -> InletOptions {
        InletOptions {
            query,
            labels: self.source_labels.clone(),
            unit: self.source_unit.clone(),
            rate_hz: self.source_rate,
        }
    }
}

fn announced(name: &str) -> AnnouncedStream {
    match name {
        "reconstructed" => AnnouncedStream::Reconstructed,
        _ => AnnouncedStream::Encoded,
    }
}

impl Options {
    /// Returns the names of the private parameters that set options.
    pub(crate) fn parameter_names() -> Vec<String> {
        let command = Options::command();
        let ids = command.get_arguments().map(|option| option.get_id().as_str());
        let ids = ids.filter(|id| !["ros_master_uri", "quiet", "verbose"].contains(id));
        ids.map(str::to_owned).collect()
    }

    /// Returns the settings of the bridge's core that the options describe.
    pub(crate) fn settings(&self) -> Settings {
        Settings {
            stamp: self.stamp,
            mains_hz: self.mains,
            filler: self.filler,
            low_latency: self.low_latency,
            announced: self.announce,
            streams: self.classifying.streams(CODES),
            event_stamps: EventStamps::Scalp,
            ..Settings::default()
        }
    }

    /// Returns the options of the live page; `None` without it.
    pub(crate) fn page(&self) -> Option<ViewOptions> {
        let is_shown = self.sink.iter().any(|sink| sink == "view");
        is_shown.then(|| self.viewing.clone())
    }

    /// Returns the mains frequency that the notch filter shall remove.
    pub(crate) fn mains(&self) -> Mains {
        Mains::from_hz(self.mains).unwrap_or(Mains::Hz50)
    }

    /// Returns the least severe level that the log shows.
    pub(crate) fn log_level(&self) -> &'static str {
        match (self.quiet, self.verbose) {
            (true, _) => "warn",
            (_, true) => "debug",
            _ => "info",
        }
    }
}

#[cfg(test)]
mod tests {
    use bridge_core::AnnouncedStream;
    use clap::{CommandFactory, Parser};
    use pipeline::Mains;

    use super::{Options, SourceKind};

    #[test]
    fn every_option_has_the_type_of_its_values_and_refuses_others() {
        Options::command().debug_assert();
        let parse = |arguments: &[&str]| {
            let arguments = ["corticode-node"].iter().chain(arguments);
            Options::try_parse_from(arguments)
        };
        let options = parse(&[]).unwrap();
        assert_eq!((options.mains(), options.log_level()), (Mains::Hz50, "info"));
        let options = parse(&[
            "--mains=60",
            "--announce=reconstructed",
            "--low-latency",
            "--sink=ros,view",
            "-q",
        ]);
        let options = options.unwrap();
        assert_eq!((options.mains(), options.log_level()), (Mains::Hz60, "warn"));
        let settings = options.settings();
        assert_eq!(settings.announced, AnnouncedStream::Reconstructed);
        assert!(settings.low_latency && settings.mains_hz == 60);
        assert!(options.page().is_some());
        for wrong in [
            &["--mains=55"][..],
            &["--announce=raw"],
            &["-q", "-v"],
            &["--port=x"],
            &["--source=lsl"],
            &["--source=lsl:colour=red"],
            &["--source-unit=furlongs"],
            &["--sink=lsl"],
        ] {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
        let options = parse(&["--source=lsl:type=EEG", "--source-labels=Cz,Pz"]).unwrap();
        let SourceKind::Lsl(query) = options.source.clone() else {
            panic!("{:?}", options.source);
        };
        let inlet = options.stream.inlet(query);
        assert_eq!((inlet.query.join("="), inlet.labels.len()), ("type=EEG".to_owned(), 2));
        let names = Options::parameter_names();
        assert!(names.contains(&"mains".to_owned()) && !names.contains(&"quiet".to_owned()));
    }
}
