//! The subcommand `doctor`: collects facts about this machine and checks them.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use bridge_core::{AnnouncedStream, Model};
use link::Streams;
use lsl::Library;
use neuro_ros::ros1::xmlrpc::{CallError, Value, call_ros};
use neuro_ros::ros1::{NodeOptions, SystemState};
use tokio::time::{Instant, timeout, timeout_at};

use crate::app::command_line::{DoctorOptions, SinkKind};
use crate::app::ros_node::Namespace;
use crate::app::ros2_outlet::ros2_domain;
use crate::doctor::device_checks::{DeviceAnswer, Probe, check_device};
use crate::doctor::port_checks::{PortFacts, PortPlace, UdevRule, UsbPort, check_port};
use crate::doctor::ros_checks::{MasterState, OwnHost, RosFacts, check_ros, master_is_here};
use crate::doctor::ros2_checks::{Ros2Facts, UNREAD, check_ros2};
use crate::doctor::{Level, Report, check_clock, check_disk, check_lsl, check_realtime};
use crate::ports::access::Program;
use crate::ports::finder::{BoardFinder, FindError};
use crate::ports::system_root::{Likeness, SystemRoot};
use crate::realtime;
use crate::wire::port::{Port, PortAddress, Transfer};

/// Time limit for the device to identify itself, and for `timedatectl` to answer.
const TIMEOUT: Duration = Duration::from_secs(3);
/// Time between two transmissions of `Identify` while the device has not introduced itself.
const RETRY: Duration = Duration::from_millis(500);

/// Paths of the udev rule, relative to the root of the file system: the administrator's file first,
/// then the files that packages install.
const RULE_FILES: [&str; 3] = [
    "etc/udev/rules.d/60-corticode.rules",
    "usr/lib/udev/rules.d/60-corticode.rules",
    "lib/udev/rules.d/60-corticode.rules",
];

/// Makes all checks of the subcommand `doctor` and returns their findings.
pub(super) async fn examine(options: &DoctorOptions, ros: &NodeOptions) -> Report {
    let root = SystemRoot::machine();
    let (place, address) = locate(&options.at.port, &root);
    let programs = root.programs();
    let is_modem_manager = |program: &Program| program.name == "ModemManager";
    let mut checks =
        check_port(&PortFacts { place, modem_manager: programs.iter().any(is_modem_manager) });
    if let Some(address) = address {
        let can_open = checks.iter().all(|check| check.level != Level::Error);
        let answer =
            if can_open { ask(&address, options.at.baud).await } else { DeviceAnswer::NotAsked };
        let model = Model::read(options.model.as_deref());
        let model = model.map_err(|error| format!("the model cannot be read: {error}"));
        checks.extend(check_device(&answer, &address.to_string(), &model));
    }
    if options.ros.sink.contains(&SinkKind::Ros) {
        checks.extend(check_ros(&ros_facts(options, ros).await));
    }
    if options.ros.sink.contains(&SinkKind::Lsl) {
        let library = Library::load(options.lsl.liblsl.as_deref());
        checks.push(check_lsl(library.map(Library::description)));
    }
    if options.ros.sink.contains(&SinkKind::Ros2) {
        checks.extend(check_ros2(&ros2_facts(options)));
    }
    checks.push(check_clock(clock_is_synchronised().await));
    let disk = rustix::fs::statvfs(".");
    let free = disk.map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize));
    checks.push(check_disk(free.ok()));
    if options.realtime.realtime {
        // Ask in a separate thread: a priority that is granted ends with that thread.
        let granted = std::thread::spawn(realtime::request).join();
        checks.extend(granted.ok().map(check_realtime));
    }
    Report::new(checks)
}

/// Returns what is known about the port, and its address if the port exists. `auto` is replaced by
/// the path of the board's port.
fn locate(address: &PortAddress, root: &SystemRoot) -> (PortPlace, Option<PortAddress>) {
    let path = match address {
        PortAddress::Tcp(_) => {
            let place = PortPlace::Network(address.to_string());
            return (place, Some(address.clone()));
        }
        PortAddress::Tty(path) => path.clone(),
        PortAddress::Auto(serial) => match BoardFinder::new(root.clone(), serial.clone()).find() {
            Ok(found) => found.path,
            Err(error) => {
                let remedy = match &error {
                    FindError::SeveralBoards { .. } => "corticode-bridge doctor --port auto:SERIAL",
                    FindError::Settling { .. } => "corticode-bridge doctor",
                    FindError::NoBoard { .. } | FindError::OtherBoards { .. } => {
                        "corticode-bridge ports (plug the board in, or name its port: --port \
                         /dev/ttyACM0)"
                    }
                };
                let (why, remedy) = (error.to_string(), remedy.to_owned());
                return (PortPlace::Missing { why, remedy }, None);
            }
        },
    };
    if !path.exists() {
        let place = PortPlace::Missing {
            why: format!("{} does not exist", path.display()),
            remedy: "corticode-bridge ports (plug the device in, or start host-sim)".to_owned(),
        };
        return (place, None);
    }
    let place = PortPlace::Terminal {
        access: root.port_access(&path),
        usb: usb_port(&path, root),
        path: path.clone(),
    };
    (place, Some(PortAddress::Tty(path)))
}

fn usb_port(path: &Path, root: &SystemRoot) -> UsbPort {
    let target = path.canonicalize().ok();
    let ports = root.serial_ports();
    let port = ports.iter().find(|port| port.path.canonicalize().ok() == target);
    match port {
        Some(port) if port.likeness() == Likeness::Board => {
            let is_installed = RULE_FILES.iter().any(|file| root.path(file).exists());
            UsbPort::Board(match (port.has_own_name(), is_installed) {
                (true, _) => UdevRule::Applied,
                (false, true) => UdevRule::Installed,
                (false, false) => UdevRule::Missing,
            })
        }
        Some(port) if port.usb.is_some() => UsbPort::Other,
        _ => UsbPort::None,
    }
}

/// Opens the port and asks the device to identify itself. The device's streams do not change.
async fn ask(address: &PortAddress, baud: u32) -> DeviceAnswer {
    let mut port = match Port::open(address, baud).await {
        Ok(port) => port,
        Err(error) => {
            return DeviceAnswer::NotOpen {
                why: format!("{address} does not open: {error}"),
                remedy: address.remedy(error.kind()),
            };
        }
    };
    let mut probe = Probe::new();
    let (mut buffer, mut outgoing) = (vec![0; 4096], Vec::new());
    let deadline = Instant::now() + TIMEOUT;
    let mut due = Instant::now();
    while Instant::now() < deadline {
        if Instant::now() >= due {
            outgoing.extend(probe.identify());
            due += RETRY;
        }
        match timeout_at(due, port.exchange(&mut buffer, &outgoing)).await {
            Err(_) => {}
            Ok(Ok(Transfer::Read(count))) => {
                if probe.receive(&buffer[..count]) {
                    break;
                }
            }
            Ok(Ok(Transfer::Written(count))) => drop(outgoing.drain(..count)),
            Ok(Ok(Transfer::NotWritten(error)) | Err(error)) => {
                let why = error.to_string();
                return DeviceAnswer::Lost { why };
            }
        }
    }
    probe.answer()
}

async fn ros_facts(options: &DoctorOptions, ros: &NodeOptions) -> RosFacts {
    let master_uri = options.ros.ros_master_uri.as_ref();
    let master_uri = master_uri.unwrap_or(&ros.master_uri).clone();
    let namespace = Namespace::new(&ros.namespace, &options.ros.topic_prefix);
    let own_host = match &ros.host {
        Some(name) => Some(OwnHost::find(name).await),
        None => None,
    };
    RosFacts {
        master: master_state(&master_uri, &namespace, &ros.name, options.asked.streams())
            .await
            .map_err(|error| error.to_string()),
        master_is_here: master_is_here(&master_uri).await,
        master_uri,
        own_host,
    }
}

fn ros2_facts(options: &DoctorOptions) -> Ros2Facts {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let domain = ros2_domain(&options.ros2, variable);
    let unread = UNREAD.into_iter();
    Ros2Facts {
        domain: options.ros2.ros_domain_id,
        localhost_only: domain.localhost_only,
        fault: domain.check().err().map(|error| error.to_string()),
        range: variable("ROS_AUTOMATIC_DISCOVERY_RANGE"),
        middleware: variable("RMW_IMPLEMENTATION"),
        distribution: variable("ROS_DISTRO"),
        unread: unread.filter(|name| variable(name).is_some()).collect(),
    }
}

async fn master_state(
    uri: &str,
    namespace: &Namespace,
    node: &str,
    streams: Streams,
) -> Result<MasterState, CallError> {
    let node = if node.starts_with('/') { node.to_owned() } else { namespace.resolve(node) };
    let caller = Value::from("/corticode_doctor");
    let state = call_ros(uri, "getSystemState", std::slice::from_ref(&caller)).await?;
    let state = SystemState::from_value(&state);
    let published = AnnouncedStream::TOPICS.into_iter();
    let published = published.filter(|(_, stream)| stream.is_in(streams));
    let publishers = published.map(|(topic, _)| {
        let topic = namespace.resolve(topic.trim_start_matches('/'));
        let nodes = state.as_ref().map(|state| state.publishers(&topic).to_vec());
        (topic, nodes.unwrap_or_default())
    });
    // The master answers with an error if the node is not registered or the parameter is not set.
    let arguments = [caller.clone(), Value::from(node.as_str())];
    let registered = call_ros(uri, "lookupNode", &arguments).await.is_ok();
    let simulated = call_ros(uri, "getParam", &[caller, Value::from("/use_sim_time")]).await;
    Ok(MasterState {
        node,
        node_is_registered: registered,
        publishers: publishers.collect(),
        use_sim_time: matches!(simulated, Ok(Value::Bool(true))),
    })
}

/// Returns whether NTP has set the clock; `None` if `timedatectl` does not say.
async fn clock_is_synchronised() -> Option<bool> {
    let output = tokio::task::spawn_blocking(|| {
        Command::new("timedatectl")
            .args(["show", "--property=NTPSynchronized", "--value"])
            .stdin(Stdio::null())
            .output()
    });
    let output = timeout(TIMEOUT, output).await.ok()?.ok()?.ok()?;
    match output.stdout.trim_ascii() {
        b"yes" => Some(true),
        b"no" => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{Level, RULE_FILES, SystemRoot, UdevRule, UsbPort, check_port, locate, usb_port};
    use crate::doctor::port_checks::PortFacts;
    use crate::ports::simulated_machine::{BOARD, OTHER, SimulatedMachine};
    use crate::wire::port::PortAddress;

    #[test]
    fn auto_leads_to_the_port_of_the_board_or_to_the_reason_and_a_remedy() {
        let machine = SimulatedMachine::new();
        let root = SystemRoot::new(machine.folder());
        let fault = || {
            let (place, address) = locate(&PortAddress::Auto(None), &root);
            assert_eq!(address, None);
            let mut checks = check_port(&PortFacts { place, modem_manager: true });
            assert_eq!((checks.len(), checks[0].level), (1, Level::Error));
            let check = checks.remove(0);
            format!("{}; {}", check.finding, check.remedy.unwrap())
        };
        assert!(fault().contains("no Corticode board is on USB; corticode-bridge ports"));
        machine.plug(2, "ttyACM0", BOARD, None);
        let path = machine.path("dev/ttyACM0");
        let (_, address) = locate(&PortAddress::Auto(None), &root);
        assert_eq!(address, Some(PortAddress::Tty(path.clone())));
        assert_eq!(usb_port(&path, &root), UsbPort::Board(UdevRule::Applied));
        let own = machine.path(&format!("dev/corticode-{}", BOARD.serial));
        assert_eq!(usb_port(&own, &root), UsbPort::Board(UdevRule::Applied));
        std::fs::remove_file(own).unwrap();
        assert_eq!(usb_port(&path, &root), UsbPort::Board(UdevRule::Missing));
        machine.write(RULE_FILES[1], "");
        assert_eq!(usb_port(&path, &root), UsbPort::Board(UdevRule::Installed));
        machine.plug_ftdi(4, "ttyUSB0");
        let ftdi = machine.path("dev/ttyUSB0");
        assert_eq!(usb_port(&ftdi, &root), UsbPort::Other);
        machine.plug(3, "ttyACM1", OTHER, None);
        let fault = fault();
        assert!(fault.ends_with("doctor --port auto:SERIAL"), "{fault}");
    }
}
