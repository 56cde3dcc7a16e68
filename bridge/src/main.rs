//! The bridge's command line.
#![forbid(unsafe_code)]

use std::error::Error;
use std::fs::File;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::sync::Arc;

use bridge::{Answer, BridgeError, Options, PortOptions, Question, Task};
use neuro_ros::ros1::NodeOptions;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::writer::{BoxMakeWriter, MakeWriterExt};

fn main() -> ExitCode {
    let (ros, arguments) = NodeOptions::from_env_and_args("acquisition");
    let task = Task::parse_from(arguments.into_iter().map(Into::into));
    let task = task.unwrap_or_else(|error| error.exit());
    let done = match task {
        Task::Bridge(options) => start(*options, ros).map(|()| ExitCode::SUCCESS),
        Task::SelfTest(options) => ask(&options.at, Question::SelfTest, options.json),
        Task::Reset(options) => ask(&options.at, Question::Reset(options.starts()), false),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            eprintln!("corticode-bridge: {error}");
            let mut source = error.source();
            while let Some(cause) = source {
                eprintln!("  because {cause}");
                source = cause.source();
            }
            ExitCode::from(error.exit_code())
        }
    }
}

fn start(options: Options, ros: NodeOptions) -> Result<(), BridgeError> {
    log_to(&ros)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()?;
    let summary = runtime.block_on(bridge::run(options, ros))?;
    eprintln!("corticode-bridge: {summary}");
    Ok(())
}

/// Ask once and print the answer; a self-test that failed is status 1.
fn ask(at: &PortOptions, question: Question, json: bool) -> Result<ExitCode, BridgeError> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let (text, passed) = match runtime.block_on(bridge::inquire(at, question))? {
        Answer::SelfTest(report) if json => {
            let json = serde_json::to_string_pretty(&report).map_err(std::io::Error::from)?;
            (json, report.passed)
        }
        Answer::SelfTest(report) => (report.to_string(), report.passed),
        Answer::Back(device) => (device.to_string(), true),
        Answer::InLoader(device) => (
            format!(
                "{} starts its loader; flash it over USB, such as with dfu-util",
                device.board
            ),
            true,
        ),
    };
    match writeln!(std::io::stdout(), "{text}") {
        // Whoever reads it, such as `head`, has had enough.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {}
        written => written?,
    }
    Ok(ExitCode::from(u8::from(!passed)))
}

/// The log goes to stderr, and to the file that roslaunch names.
fn log_to(ros: &NodeOptions) -> Result<(), BridgeError> {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    let writer = match &ros.log {
        None => BoxMakeWriter::new(std::io::stderr),
        Some(path) => {
            let file = File::options().create(true).append(true).open(path);
            let file = file.map_err(|source| BridgeError::Log {
                path: path.clone(),
                source,
            })?;
            BoxMakeWriter::new(std::io::stderr.and(Arc::new(file)))
        }
    };
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(false)
        .with_writer(writer)
        .init();
    Ok(())
}
