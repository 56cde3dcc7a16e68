//! The program `corticode-bridge`: reads the options, runs a task and returns the exit status.

pub(crate) mod bridge;
mod browser;
mod calibrate;
pub(crate) mod classifying;
pub(crate) mod command_line;
pub(crate) mod config_file;
mod convert;
mod doctor;
mod driver;
mod event_times;
mod given_options;
mod impedance;
mod live_recording;
pub(crate) mod log;
mod manual;
mod master;
mod outlet;
mod outlets;
mod page_commands;
pub(crate) mod parameters;
mod ports;
mod record;
mod recorders;
mod replay;
mod replay_feed;
#[cfg(feature = "ros2")]
pub(crate) mod ros2_outlet;
#[cfg(not(feature = "ros2"))]
#[path = "app/ros2_absent.rs"]
pub(crate) mod ros2_outlet;
mod ros_args;
pub(crate) mod ros_node;
mod ros_status;
mod ros_topics;
mod rosout;
mod shutdown;
mod sinks;
mod step_times;
mod update;
mod whole_lines;

use std::fmt;
use std::path::PathBuf;
use std::process::ExitCode;

use bridge_core::{Answer, Request};
use neuro_ros::Log;
use neuro_ros::ros1::NodeOptions;
use serde::Serialize;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::mpsc::Receiver;

use crate::app::command_line::{
    CalibrateOptions, DoctorOptions, Options, PortOptions, PortsOptions, Task, command,
};
use crate::app::config_file::ConfigFile;
use crate::app::given_options::GivenOptions;
use crate::app::ports::PortList;
use crate::error::BridgeError;
use crate::ports::system_root::SystemRoot;
use crate::query::query_port;

/// Text of the udev rule that lets users open boards on USB and gives each board a fixed name.
const UDEV_RULE: &str = include_str!("../../../packaging/60-corticode.rules");

/// Runs `corticode-bridge` with the arguments and environment of this process and returns its exit
/// status.
///
/// Status 0 means success, 1 a failed check, 2 wrong usage, 3 that the device or ROS is not
/// reachable, and 4 that the device refuses the request. Without a subcommand the bridge streams
/// until a Unix signal or ROS ends it. `selftest` and `reset` send the device one request and print
/// its answer. `update` writes new firmware to it. `record` writes everything on the wire to a
/// file, which `replay` and `convert` read. `calibrate` fits a packed model to a person, and
/// `impedance` shows the contacts of the electrodes. `ports` and `doctor` print the state of this
/// machine. `master` runs a ROS master until a Unix signal ends it. `completions` prints a shell
/// completion script, and `man` the manual page.
pub fn run() -> ExitCode {
    match read_arguments() {
        Ok(code) => code,
        Err(error) => error.report("corticode-bridge"),
    }
}

/// Reads the arguments of ROS and of the program, and performs the task that they name.
fn read_arguments() -> Result<ExitCode, BridgeError> {
    let arguments = std::env::args_os().map(|text| text.to_string_lossy().into_owned());
    let arguments = ros_args::to_ros1(arguments)?;
    let variable = |name: &str| std::env::var(name).ok();
    let (ros, arguments) = NodeOptions::parse("acquisition", variable, arguments);
    let (task, config) = read_task(&ros, arguments)?;
    perform(task, ros, config)
}

/// Performs a task, and returns the exit status of the program.
fn perform(task: Task, ros: NodeOptions, config: Option<PathBuf>) -> Result<ExitCode, BridgeError> {
    match task {
        Task::Bridge(options) => stream(*options, ros, config)?,
        Task::SelfTest(options) => {
            return send_request(&options.at, Request::SelfTest, options.json);
        }
        Task::Reset(options) => {
            return send_request(&options.at, Request::Reset(options.target()), false);
        }
        Task::Update(options) => {
            let device = update::run(options, one_thread()?)?;
            new_file::print(format_args!("{device}\n"))?;
        }
        Task::Record(options) => {
            init_log(&ros, config)?;
            print_summary(&Runtime::new()?.block_on(record::record(options))?);
        }
        Task::Replay(options) => {
            init_log(&ros, None)?;
            if options.live {
                let shown = one_thread()?.block_on(Box::pin(replay::show(options, ros)));
                print_summary(&shown?);
            } else {
                print_summary(&Runtime::new()?.block_on(replay::replay(&options))?);
            }
        }
        Task::Convert(options) => {
            init_log(&ros, config)?;
            print_summary(&convert::convert(&options)?);
        }
        Task::Calibrate(options) => calibrate(*options, &ros, config)?,
        Task::Impedance(options) => {
            init_log(&ros, config)?;
            one_thread()?.block_on(impedance::show(options))?;
        }
        Task::Ports(options) => list_ports(&options)?,
        Task::Doctor(options) => return examine(&options, &ros),
        Task::Master(options) => {
            init_log(&ros, None)?;
            Runtime::new()?.block_on(master::run(&options))?;
        }
        Task::Completions(options) => new_file::print(manual::script(&options, command()))?,
        Task::Man(options) => {
            let pages = manual::pages(&options, command())?;
            new_file::print(String::from_utf8_lossy(&pages))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Reads the options from the command line, the environment, the parameter server and the
/// configuration file; an earlier source overrides a later one. Wrong usage and requests for help
/// end the process. Also returns the path of the configuration file, for the log, if the file sets
/// an option.
fn read_task(
    ros: &NodeOptions,
    arguments: Vec<String>,
) -> Result<(Task, Option<PathBuf>), BridgeError> {
    let arguments = parameters::to_flags(arguments, &Options::parameter_names())?;
    let parse = |command, arguments: &[String]| {
        GivenOptions::parse_from(command, arguments).unwrap_or_else(|error| error.exit())
    };
    // Ignore errors in this first parse: an option that is missing here may be in the configuration
    // file. The second parse, which includes the file, reports wrong usage.
    let given = parse(command().ignore_errors(true), &arguments);
    let (mut path, mut others) = (None, Vec::new());
    if given.reads_config()
        && let Some(file) = ConfigFile::read(given.config(), |name| std::env::var_os(name))?
    {
        path = Some(file.path).filter(|_| !file.options.is_empty());
        others = file.options;
        others.retain(|(name, _)| given.knows(name) && !given.is_set(name));
        if names_master() {
            others.retain(|(name, _)| name != "ros_master_uri");
        }
    }
    let values = |others: &[(String, String)]| {
        let values = others.iter().map(|(_, argument)| argument.clone());
        given.extend(&arguments, values)
    };
    let with_file = parse(command(), &values(&others));
    if with_file.is_ros_bridge() {
        let master_uri = with_file.ros_master_uri().unwrap_or(&ros.master_uri);
        let runtime = one_thread()?;
        let names = Options::parameter_names();
        let parameters = runtime.block_on(parameters::read(ros, master_uri, &names));
        // Dropping the runtime would wait until an unfinished lookup of the master's host name
        // ends.
        runtime.shutdown_background();
        for (name, argument) in parameters? {
            if !given.is_set(&name) {
                others.retain(|(known, _)| *known != name);
                others.push((name, argument));
            }
        }
    }
    let task = Task::parse_from(values(&others).into_iter().map(Into::into));
    let task = task.unwrap_or_else(|error| error.exit());
    if let (Task::SelfTest(_) | Task::Reset(_) | Task::Update(_), Some(path)) = (&task, &path) {
        // These subcommands have no log, so name the file on standard error.
        new_file::message!("corticode-bridge: options from {}", path.display());
    }
    Ok((task, path))
}

/// Returns whether `__master:=` or `ROS_MASTER_URI` names the ROS master; both override the master
/// in the configuration file.
fn names_master() -> bool {
    let variable = std::env::var_os("ROS_MASTER_URI");
    let mut arguments = std::env::args_os();
    variable.is_some_and(|uri| !uri.is_empty())
        || arguments.any(|argument| argument.to_string_lossy().starts_with("__master:="))
}

fn stream(options: Options, ros: NodeOptions, config: Option<PathBuf>) -> Result<(), BridgeError> {
    let lines = init_log(&ros, config)?;
    // One thread reads the port and writes the sockets: a code passed to another thread would wait
    // until that thread wakes up.
    let runtime = one_thread()?;
    let summary = runtime.block_on(bridge::stream(options, ros, lines));
    // Dropping the runtime would wait for an unfinished lookup of a host name.
    runtime.shutdown_background();
    print_summary(&summary?);
    Ok(())
}

fn calibrate(
    options: CalibrateOptions,
    ros: &NodeOptions,
    config: Option<PathBuf>,
) -> Result<(), BridgeError> {
    init_log(ros, config)?;
    let runtime = Runtime::new()?;
    let calibrated = runtime.block_on(calibrate::calibrate(options));
    // Dropping the runtime would wait for a fit that the user has interrupted.
    runtime.shutdown_background();
    Ok(new_file::print(calibrated?)?)
}

/// Sends one request to the device and prints the answer. Exit status 1 means a failed self-test.
fn send_request(at: &PortOptions, request: Request, json: bool) -> Result<ExitCode, BridgeError> {
    let runtime = one_thread()?;
    let text = match runtime.block_on(query_port(&at.port, at.baud, request))? {
        Answer::SelfTest(report) => {
            print_report(&report, json)?;
            return Ok(ExitCode::from(u8::from(!report.passed)));
        }
        Answer::Identified(device) | Answer::Restarted(device) => device.to_string(),
        Answer::InBootloader(device) => format!(
            "{} starts its bootloader; write an image to it with corticode-bridge update",
            device.board
        ),
    };
    new_file::print(format_args!("{text}\n"))?;
    Ok(ExitCode::SUCCESS)
}

fn list_ports(options: &PortsOptions) -> Result<(), BridgeError> {
    if options.udev_rule {
        return Ok(new_file::print(UDEV_RULE)?);
    }
    let ports = PortList::read(&SystemRoot::machine());
    print_report(&ports, options.json)
}

/// Checks what the bridge needs and prints the findings. Returns exit status 1 if a finding is an
/// error.
fn examine(options: &DoctorOptions, ros: &NodeOptions) -> Result<ExitCode, BridgeError> {
    let runtime = one_thread()?;
    let report = runtime.block_on(doctor::examine(options, ros));
    // Dropping the runtime would wait until an unfinished lookup of a host name ends.
    runtime.shutdown_background();
    print_report(&report, options.json)?;
    Ok(ExitCode::from(u8::from(report.errors > 0)))
}

/// Returns a tokio runtime that runs all tasks in the thread that calls `block_on`.
fn one_thread() -> std::io::Result<Runtime> {
    Builder::new_current_thread().enable_all().build()
}

/// Prints the last line of a subcommand on standard error.
fn print_summary(summary: &impl fmt::Display) {
    new_file::message!("corticode-bridge: {summary}");
}

fn print_report(report: &(impl Serialize + fmt::Display), json: bool) -> Result<(), BridgeError> {
    let text = if json {
        serde_json::to_string_pretty(report).map_err(std::io::Error::from)?
    } else {
        report.to_string()
    };
    Ok(new_file::print(format_args!("{text}\n"))?)
}

/// Starts the log, and writes the path of the configuration file to it, if one was read. Returns
/// the lines of the log for `/rosout`.
fn init_log(ros: &NodeOptions, config: Option<PathBuf>) -> Result<Receiver<Log>, BridgeError> {
    let lines = log::start(ros, "info")?;
    if let Some(path) = config {
        tracing::info!("options from {}", path.display());
    }
    Ok(lines)
}
