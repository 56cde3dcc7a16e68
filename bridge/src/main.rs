//! The bridge's command line.
#![forbid(unsafe_code)]

use std::error::Error;
use std::fs::File;
use std::process::ExitCode;
use std::sync::Arc;

use bridge::{BridgeError, Options};
use clap::Parser;
use neuro_ros::ros1::NodeOptions;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::writer::{BoxMakeWriter, MakeWriterExt};

fn main() -> ExitCode {
    let (ros, arguments) = NodeOptions::from_env_and_args("acquisition");
    let options = Options::parse_from(arguments);
    match start(options, ros) {
        Ok(()) => ExitCode::SUCCESS,
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
