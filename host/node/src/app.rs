//! The program `corticode-node`: reads the options, starts the log and publishes codes.

use std::process::ExitCode;

use bridge::{
    BridgeError, LivePage, Namespace, Publication, ignore_empty_variable, parameters_to_flags,
    read_parameters, start_log,
};
use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory, FromArgMatches};
use lsl::Library;
use neuro_ros::ros1::{Node, NodeOptions};
use neuro_ros::{NeuroFrame, RosMessage, Stamp};

use crate::command_line::{Options, SourceKind};
use crate::feed::SourceFeed;
use crate::frames::Frames;

/// Number of received frames that can wait for this program: 64 s at 16 frames per second.
const QUEUE_FRAMES: usize = 1024;

/// Runs `corticode-node` with the arguments and environment of this process and returns its exit
/// status.
pub fn run() -> ExitCode {
    let (ros, arguments) = NodeOptions::from_env_and_args("corticode");
    match publish(ros, arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => error.report("corticode-node"),
    }
}

fn publish(mut ros: NodeOptions, arguments: Vec<String>) -> Result<(), BridgeError> {
    if !model::HAS_NETWORK {
        return Err(BridgeError::NoNetwork);
    }
    // One thread reads the frames and writes the sockets: a code passed to another thread would
    // wait until that thread wakes up.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let names = Options::parameter_names();
    let arguments = parameters_to_flags(arguments, &names)?;
    let given = matches(&arguments);
    if let Some(uri) = given.get_one::<String>("ros_master_uri") {
        ros.master_uri.clone_from(uri);
    }
    let parameters = runtime.block_on(read_parameters(&ros, &ros.master_uri, &names))?;
    let is_set = |name: &str| {
        let source = given.value_source(name);
        source.is_some_and(|source| source != ValueSource::DefaultValue)
    };
    let parameters = parameters.into_iter().filter(|(name, _)| !is_set(name));
    let mut all: Vec<String> = arguments.iter().take(1).cloned().collect();
    all.extend(parameters.map(|(_, flag)| flag));
    all.extend(arguments.into_iter().skip(1));
    let options = Options::from_arg_matches(&matches(&all)).unwrap_or_else(|error| error.exit());
    let log = start_log(&ros, options.log_level())?;
    let classifier = options.classifying.read()?;
    let publication = Publication {
        settings: options.settings(),
        model: options.model.clone(),
        upload_model: options.person.clone().folder()?,
        ros,
        topic_prefix: options.topic_prefix.clone(),
        get_info: "~get_info",
        exclusions: options.exclusion.exclusions(),
        impedance: None,
        classifying: classifier.map(|classifier| options.predicting.classifying(classifier)),
        exit_at_end: false,
        realtime: options.realtime.realtime,
        record_dir: options.viewing.record_dir.clone(),
    };
    let page = options.page().map(|page| LivePage::new("corticode-node", page));
    let mains = options.mains();
    let stream = match options.source.clone() {
        SourceKind::Ros => None,
        SourceKind::Lsl(query) => {
            let library = Library::load(options.stream.liblsl.as_deref())?;
            tracing::info!("{}", library.description());
            Some(Frames::from_stream(library, options.stream.inlet(query))?)
        }
    };
    let connect = async |node: &Node, namespace: &Namespace| {
        let frames = if let Some(stream) = stream {
            stream
        } else {
            let topic = namespace.resolve("neurodata");
            let topic = node.subscribe(&topic, NeuroFrame::TYPE, QUEUE_FRAMES);
            Frames::Topic(topic.await?)
        };
        Ok(SourceFeed::new(frames, mains, Stamp::now().nsecs))
    };
    let summary = runtime.block_on(Box::pin(publication.publish(log, connect, page)));
    // Dropping the runtime would wait for an unfinished lookup of a host name.
    runtime.shutdown_background();
    let summary = summary?;
    new_file::message!("corticode-node: {summary}");
    Ok(())
}

/// Parses the arguments. Wrong usage and requests for help end the process.
fn matches(arguments: &[String]) -> ArgMatches {
    let command = Options::command().mut_args(ignore_empty_variable);
    let matches = command.try_get_matches_from(arguments);
    matches.unwrap_or_else(|error| error.exit())
}
