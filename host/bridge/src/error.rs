//! Errors that end the bridge or one of its subcommands.

use std::error::Error as _;
use std::path::PathBuf;
use std::process::ExitCode;

use artifact::{ArtifactError, ModelId};
use bridge_core::QueryError;
use capture::{ConvertError, RecordingError};
use model_gen::ModelGenError;
use neuro_ros::SinkError;
use neuro_ros::ros1::NodeError;
use new_file::NewFileError;
use packed_fit::FitError;
use picture::canvas::PictureError;
use thiserror::Error;

use crate::app::config_file::ConfigError;
use crate::app::ros2_outlet;
use crate::update::UpdateError;

/// Error that ends the bridge or one of its subcommands. An absent device or ROS master is no error
/// for the streaming bridge, which waits.
#[derive(Debug, Error)]
pub enum BridgeError {
    /// The program is asked to compute codes, but its built-in model has no network to encode with.
    #[error(
        "this program was built with a model without a network, which has no codes; build it with another model \
         (CORTICODE_ARTIFACT)"
    )]
    NoNetwork,
    /// `--port` names something that is not a port.
    #[error("{0} cannot be a port; name a serial port, such as /dev/ttyACM0, or tcp:HOST:PORT")]
    Port(String, #[source] std::io::Error),
    /// The terminal driver does not support the baud rate.
    #[error("{0} cannot be used; choose another --baud")]
    Speed(String, #[source] std::io::Error),
    /// `--port auto` finds several boards; holds their serial numbers and ports.
    #[error("several Corticode boards are connected: {0}; choose one, --port auto:SERIAL")]
    SeveralBoards(String),
    /// `--model` names no valid model, or a model whose codes cannot be decoded.
    #[error(
        "the model cannot be read; --model takes the folder of an artifact, which `trainer train` and `trainer packed` write"
    )]
    Model(#[source] ArtifactError),
    /// The packed model of `--upload-model` cannot be turned into the device's integers.
    #[error("the packed model cannot be used on a device; fit it again, with `trainer packed`")]
    Upload(#[source] ModelGenError),
    /// The model of `--upload-model` has no packed code.
    #[error(
        "the model in {} has no packed code, so there is nothing to upload; `trainer packed` adds one, and --model \
         decodes with it as it is", .0.display()
    )]
    NothingToUpload(PathBuf),
    /// `--classifier` names no classifier.
    #[error("the classifier {} cannot be used", .0.display())]
    Classifier(PathBuf, #[source] artifact::classifier::ClassifierError),
    /// The Lab Streaming Layer is an outlet, and its library cannot be used.
    #[error(transparent)]
    Liblsl(#[from] lsl::LibraryError),
    /// The user asks for features, but names no classifier that uses them.
    #[error(
        "the stream features needs a classifier; name its file with --classifier (`trainer classify` writes one)"
    )]
    NoClassifier,
    /// A recording cannot be used for a fit, or nothing can be fitted to it.
    #[error("no model can be fitted")]
    Fit(#[from] FitError),
    /// The model of the device has no packed code that could be fitted to a person.
    #[error(
        "model {0} has no packed code, so there is nothing to fit to a person; `trainer packed` adds one, and an \
         image built with it (CORTICODE_ARTIFACT) takes personal ones"
    )]
    NothingToCalibrate(ModelId),
    /// The signal has fewer good seconds than the fit needs.
    #[error(
        "{good} of {judged} s are good signal, and {wanted} s are needed: record more, or fit to fewer with \
         --seconds, to 20 at least{bad}"
    )]
    TooLittleSignal {
        /// Number of good seconds.
        good: usize,
        /// Number of seconds in which no step is missing.
        judged: usize,
        /// Number of seconds that `--seconds` asks for.
        wanted: usize,
        /// Text that lists the bad electrodes and the bad seconds of each, preceded by a semicolon;
        /// empty if no electrode was bad.
        bad: String,
    },
    /// A recording lacks too many of the model's electrodes, so it was made with another cap.
    #[error(
        "the recording {name} lacks {lacking} of the {electrodes} electrodes of the model, too many to interpolate; \
         name the folder of the model for this cap with --model"
    )]
    OtherElectrodes {
        /// File name of the recording.
        name: String,
        /// Number of the model's electrodes that the recording lacks.
        lacking: usize,
        /// Number of the model's electrodes.
        electrodes: usize,
    },
    /// The device has other electrodes, rates or windows than the model from which the fit starts.
    #[error(
        "the device, a {0}, has another montage or window than the model in this program; name the folder of the \
         device's model with --model"
    )]
    OtherMontage(String),
    /// The device refuses the stream of filtered steps.
    #[error(
        "the device streams no filtered steps: its port is too slow for 33 kB/s, or its firmware is older than this \
         program; use its USB port, or calibrate from a recording, with --recording"
    )]
    NoFilteredSteps,
    /// The device accepts no packed model.
    #[error(
        "the device, a {0}, takes no packed model: it has no memory for one, its image has no packed code, or its \
         firmware is older than this program; use a NUCLEO-H743ZI2 or host-sim, or fit a model to a recording, with \
         --recording, and build an image with it (CORTICODE_ARTIFACT)"
    )]
    NoSlot(String),
    /// The network of the model has no linear map whose place a person's linear code could take.
    #[error(
        "the network of model {0} has no linear map in whose place a person's numbers could be computed; calibrate \
         without --numbers, or flash an image of a model of mode shortcut or pca, and name its folder with --model"
    )]
    NoLinearMap(ModelId),
    /// The device cannot take a linear code that was fitted to a person.
    #[error(
        "the device, a {0}, takes no numbers of a person: it has no memory for a model, its image has no network or \
         one without a linear map, or its firmware is older than this program; calibrate without --numbers, use a \
         NUCLEO-H743ZI2 or host-sim, or fit to a recording, with --recording, and build an image with the model \
         (CORTICODE_ARTIFACT)"
    )]
    NoNumbers(String),
    /// The device does not use the uploaded model.
    #[error(
        "the device has not taken the model: the log says why, if it has answered; the model is kept: stream with \
         it as above, which sends it again, or build an image with it (CORTICODE_ARTIFACT), which needs no upload"
    )]
    NotGiven,
    /// The device does not measure the impedance of the electrodes; the text says why.
    #[error("{0}")]
    NoImpedance(String),
    /// A picture cannot be drawn.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The user has interrupted `calibrate` during the upload to the device.
    #[error(
        "interrupted; the model is kept: stream with it as above, which sends it to the device"
    )]
    InterruptedUpload,
    /// The user has interrupted `calibrate` before the model was written.
    #[error("interrupted; nothing was written, and the device keeps its model")]
    Interrupted,
    /// Neither `XDG_DATA_HOME` nor `HOME` names a folder.
    #[error(
        "the folder for models is not known, because neither XDG_DATA_HOME nor HOME is an absolute path; set one, or \
         name the folder of the model itself (calibrate --output, --upload-model)"
    )]
    NoDataFolder,
    /// No model was fitted to the subject.
    #[error(
        "{} has no model of {subject}; {}", folder.display(), known_words(known)
    )]
    NoSubject {
        /// Name of the subject.
        subject: String,
        /// Folder of all subjects' models.
        folder: PathBuf,
        /// Subjects that have models.
        known: Vec<String>,
    },
    /// The folder of all models, or the folder of a subject's models, cannot be read.
    #[error(
        "the models in {} cannot be read; name the folder of one with --upload-model", .0.display()
    )]
    SubjectModels(PathBuf, #[source] std::io::Error),
    /// The folder of a model exists, or cannot be written.
    #[error("the model cannot be written to {}; choose another folder with --output", .0.display())]
    ModelFolder(PathBuf, #[source] std::io::Error),
    /// `--announce` needs a stream that is not in `--streams`.
    #[error(
        "--announce names a stream that --streams leaves out; add it to --streams, such as \
         --streams codes,raw --announce raw"
    )]
    AnnouncedNotStreamed,
    /// The configuration file cannot be used.
    #[error("the configuration file {} cannot be used", .0.display())]
    Config(PathBuf, #[source] ConfigError),
    /// A private parameter, `_name:=` or `~name`, has the name of no option.
    #[error("the private parameter {name} is not known; {remedy}; known are {known}")]
    UnknownParameter {
        /// Name of the parameter, without the node's name.
        name: String,
        /// Advice for the user.
        remedy: String,
        /// Names of all parameters that the bridge knows.
        known: String,
    },
    /// A parameter on the parameter server has a value that no option can have. Holds the
    /// parameter's full name.
    #[error("the parameter {0} is neither text, number, truth value nor list; set it again")]
    ParameterType(String),
    /// The port does not open, or is lost during a request. Unlike the streaming bridge, `selftest`
    /// and `reset` do not wait for the port.
    #[error("{port} {what}; {remedy}")]
    Unreachable {
        /// Address from `--port`.
        port: String,
        /// Verb phrase that follows the port, such as `does not open`.
        what: &'static str,
        /// Advice for the user.
        remedy: String,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The device does not answer a request, or refuses it.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// The device's firmware is not updated.
    #[error(transparent)]
    Update(#[from] UpdateError),
    /// The ROS node's name or the master's URI is invalid, or the node's network ports cannot be
    /// opened.
    #[error("the ROS node cannot start; check the name, ROS_IP and ROS_MASTER_URI")]
    Node(#[from] NodeError),
    /// The ROS 2 node cannot start, or one of its topics or services cannot be created.
    #[error("ROS 2 cannot be used")]
    Ros2(#[from] ros2_outlet::Ros2Error),
    /// An argument after `--ros-args` is not known or not complete.
    #[error(
        "{0} after --ros-args cannot be used; this program knows -r FROM:=TO and -p NAME:=VALUE there; --config names \
         a file of options, and RUST_LOG the level of the log"
    )]
    RosArgument(String),
    /// The ROS master cannot listen on the address from `--bind`.
    #[error(
        "the ROS master cannot listen at {0}; end the master that uses this port, or choose \
         an IP address of this machine and another port, such as --bind 127.0.0.1:11312"
    )]
    MasterAddress(std::net::SocketAddr, #[source] std::io::Error),
    /// The live page cannot listen on the address from `--view-address`.
    #[error(
        "the live page cannot listen at {0}; end the program that uses this port, or choose an IP address of this \
         machine and another port, such as --view-address 127.0.0.1:8062"
    )]
    ViewAddress(std::net::SocketAddr, #[source] std::io::Error),
    /// The JSON lines cannot be written: their reader closed the pipe or does not read, or the
    /// output failed.
    #[error("frames cannot be published")]
    Sink(#[from] SinkError),
    /// The log file that roslaunch requested cannot be written.
    #[error("the log file {} cannot be written; check __log:= or the disk", .0.display())]
    Log(PathBuf, #[source] std::io::Error),
    /// A file cannot be written under its name: a file with this name exists, the recording to read
    /// has this name, or the operating system cannot create or complete the file.
    #[error(transparent)]
    NewFile(#[from] NewFileError),
    /// A recording's file cannot be written any further, because the disk is full or fails.
    #[error(
        "{} cannot be written any further; everything up to here is in the file, so make room \
         on the disk and go on with another file", .0.display()
    )]
    FileWrite(PathBuf, #[source] std::io::Error),
    /// `replay` cannot create the port on which it plays the recording.
    #[error(
        "{0} cannot be made a port; choose pty:PATH with a path in a writable folder that no \
         file has, or tcp:HOST:PORT with a free port"
    )]
    Output(String, #[source] std::io::Error),
    /// The file to play is not a usable recording.
    #[error("{} cannot be used as a recording", .0.display())]
    Recording(PathBuf, #[source] RecordingError),
    /// The recording cannot be converted.
    #[error(transparent)]
    Convert(#[from] ConvertError),
    /// The operating system does not provide a signal handler, a thread or stdout.
    #[error("the operating system refuses a resource that this program needs")]
    System(#[from] std::io::Error),
}

impl BridgeError {
    /// Prints the error and its causes to stderr, and returns the exit status of the program.
    pub fn report(&self, program: &str) -> ExitCode {
        new_file::message!("{program}: {self}");
        let mut source = self.source();
        while let Some(cause) = source {
            new_file::message!("  because {cause}");
            source = cause.source();
        }
        ExitCode::from(self.exit_code())
    }

    /// Returns the exit status of the program: 1 if a check or the output failed, 2 for wrong
    /// usage, 3 if the device or ROS is not reachable, 4 if the device refuses the request.
    pub fn exit_code(&self) -> u8 {
        match self {
            BridgeError::Sink(_)
            | BridgeError::Interrupted
            | BridgeError::InterruptedUpload
            | BridgeError::System(_)
            | BridgeError::Picture(_)
            | BridgeError::FileWrite(..)
            | BridgeError::NewFile(NewFileError::Write { .. } | NewFileError::Finish { .. })
            | BridgeError::Convert(ConvertError::NewFile(
                NewFileError::Write { .. } | NewFileError::Finish { .. },
            )) => 1,
            BridgeError::Port(..)
            | BridgeError::Speed(..)
            | BridgeError::SeveralBoards(..)
            | BridgeError::Model(_)
            | BridgeError::Upload(_)
            | BridgeError::NothingToUpload(_)
            | BridgeError::Fit(_)
            | BridgeError::NothingToCalibrate(_)
            | BridgeError::NoLinearMap(_)
            | BridgeError::TooLittleSignal { .. }
            | BridgeError::OtherElectrodes { .. }
            | BridgeError::OtherMontage(_)
            | BridgeError::NoDataFolder
            | BridgeError::NoSubject { .. }
            | BridgeError::SubjectModels(..)
            | BridgeError::NoNetwork
            | BridgeError::Log(..)
            | BridgeError::NewFile(_)
            | BridgeError::Recording(..)
            | BridgeError::Convert(_)
            | BridgeError::Output(..)
            | BridgeError::AnnouncedNotStreamed
            | BridgeError::Classifier(..)
            | BridgeError::NoClassifier
            | BridgeError::Liblsl(_)
            | BridgeError::Config(..)
            | BridgeError::MasterAddress(..)
            | BridgeError::ViewAddress(..)
            | BridgeError::UnknownParameter { .. }
            | BridgeError::ParameterType(..)
            | BridgeError::RosArgument(_)
            | BridgeError::Node(NodeError::Name(_) | NodeError::MasterUri(_)) => 2,
            BridgeError::ModelFolder(_, source) => match source.kind() {
                std::io::ErrorKind::AlreadyExists => 2,
                _ => 1,
            },
            BridgeError::Ros2(error) if ros2_outlet::is_usage(error) => 2,
            BridgeError::Node(_) | BridgeError::Ros2(_) | BridgeError::Unreachable { .. } => 3,
            BridgeError::NoFilteredSteps
            | BridgeError::NoSlot(_)
            | BridgeError::NoNumbers(_)
            | BridgeError::NotGiven
            | BridgeError::NoImpedance(_) => 4,
            BridgeError::Query(error) => error.exit_code(),
            BridgeError::Update(error) => error.exit_code(),
        }
    }
}

/// Returns an error and its causes as one sentence.
pub(crate) fn causes(error: &BridgeError) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}, because {cause}");
        source = cause.source();
    }
    text
}

/// Returns the part of an error message that lists the subjects with models.
fn known_words(known: &[String]) -> String {
    match known {
        [] => "there is none of anybody yet: `corticode-bridge calibrate` fits one".to_owned(),
        known => format!(
            "it has models of {}; `corticode-bridge calibrate` fits another",
            known.join(", ")
        ),
    }
}
