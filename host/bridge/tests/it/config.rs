//! The configuration file of the program, and the sources of options that override it.

use std::path::PathBuf;

use neuro_ros::ros1::Master;
use neuro_ros::ros1::xmlrpc::{Value, call_ros};
use rustix::process::Signal;
use tempfile::TempDir;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::graph::{ended, frame, master, node, subscribe};
use crate::process::{Bridge, wait_until};

/// Writes a configuration file to a new folder. Returns the folder and the file's path.
fn config(text: &str) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bridge.toml");
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap().to_owned();
    (folder, path)
}

/// Starts the bridge, waits for a frame on `topic`, ends the bridge and returns its log.
async fn log_of_bridge_on(
    master: &Master,
    topic: &str,
    arguments: &[&str],
    variables: &[(&str, &str)],
) -> String {
    let node = node("recorder", master.uri()).await;
    let mut encoded = subscribe(&node, topic).await;
    let bridge = Bridge::start_with(arguments, variables);
    frame(&mut encoded).await;
    bridge.signal(Signal::TERM);
    ended(bridge).await
}

#[tokio::test]
async fn flags_override_environment_parameters_and_file_in_this_order() {
    let master = master().await;
    let device = Device::tcp(Board::new());
    let uri = master.uri();
    let text = format!(
        "port = \"{}\"\nros_master_uri = \"{uri}\"\ntopic_prefix = \"/file\"\n",
        device.port
    );
    let (_folder, path) = config(&text);
    let file = ("CORTICODE_CONFIG", &*path);
    let log = log_of_bridge_on(&master, "/file/encoded", &[], &[file]).await;
    assert_eq!(log.matches(&format!("options from {path}")).count(), 1);

    let server = ["/test", "/acquisition/topic_prefix", "/server"].map(Value::from);
    call_ros(uri, "setParam", &server).await.unwrap();
    log_of_bridge_on(&master, "/server/encoded", &["--config", &path], &[]).await;
    let environment = ("CORTICODE_TOPIC_PREFIX", "/environment");
    log_of_bridge_on(&master, "/environment/encoded", &[], &[file, environment]).await;
    let flag = ["--topic-prefix", "/flag"];
    log_of_bridge_on(&master, "/flag/encoded", &flag, &[file, environment]).await;
}

#[tokio::test]
async fn the_address_of_the_master_in_the_file_is_overridden_by_ros() {
    let master = master().await;
    let device = Device::tcp(Board::new());
    let text = format!("port = \"{}\"\nros_master_uri = \"http://127.0.0.1:1/\"\n", device.port);
    let (_folder, path) = config(&text);
    let file = ("CORTICODE_CONFIG", &*path);
    let variable = ("ROS_MASTER_URI", master.uri());
    log_of_bridge_on(&master, "/encoded", &[], &[file, variable]).await;
    let argument = format!("__master:={}", master.uri());
    log_of_bridge_on(&master, "/encoded", &[&argument], &[file]).await;
}

#[test]
fn the_file_of_the_user_is_found_and_applies_to_subcommands() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("corticode/bridge.toml");
    std::fs::create_dir(path.parent().unwrap()).unwrap();
    // The file may set --streams for the bridge, although `selftest` has no such option.
    std::fs::write(&path, "port = \"/nowhere\"\nstreams = [\"raw\"]\n").unwrap();
    let home = ("XDG_CONFIG_HOME", folder.path().to_str().unwrap());
    let recording = folder.path().join("a.wire");
    let record = ["record", recording.to_str().unwrap()];
    for (arguments, port) in [
        (&["selftest"][..], "/nowhere"),
        (&["reset", "--bootloader"], "/nowhere"),
        (&["selftest", "--port=/elsewhere"], "/elsewhere"),
    ] {
        let log = Bridge::start_in_home(arguments, home).failure(3);
        let read = format!("options from {}", path.display());
        assert_has(&log, [&read, &format!("{port} does not open")]);
    }
    let bridge = Bridge::start_in_home(&record, home);
    wait_until("the recording", || recording.exists());
    let log = bridge.end(Signal::TERM);
    assert!(log.contains("options from"), "{log}");
}

#[test]
fn required_options_can_be_in_the_file() {
    let (_folder, path) = config("subject = \"ada\"\nmains = 50\n");
    let calibrate = ["calibrate", "--output=/dev/null/model", "--recording=/missing.gdf"];
    let log = Bridge::start_with(&calibrate, &[("CORTICODE_CONFIG", &path)]).failure(1);
    assert_has(&log, ["options from", "cannot be written to /dev/null"]);
    let log = Bridge::start_with(&calibrate, &[("CORTICODE_CONFIG", "/dev/null")]).failure(2);
    assert_has(&log, ["--subject", "--mains"]);
}

#[test]
fn an_unusable_file_is_status_2_and_the_message_names_file_line_and_key() {
    let folder = tempfile::tempdir().unwrap();
    let missing: PathBuf = folder.path().join("missing.toml");
    let run = |path: &str| {
        let log = Bridge::start(&["--config", path]).failure(2);
        assert!(log.contains(path), "{log}");
        log
    };
    let log = run(missing.to_str().unwrap());
    assert!(log.contains("No such file"), "{log}");
    // Unit tests of the program check the messages of other mistakes.
    let (_folder, path) = config("# comment\nprot = \"/dev/null\"");
    let log = run(&path);
    assert_has(&log, ["line 2: the key prot is not known; known are port, baud"]);
}

#[test]
fn convert_takes_the_model_of_the_file_and_replay_reads_no_file() {
    let (_folder, path) = config("model = \"/nowhere\"\nport = \"/nowhere\"\n");
    let file = [("CORTICODE_CONFIG", &*path)];
    let replay = ["replay", "/missing.wire", "--output=tcp:127.0.0.1:1"];
    let log = Bridge::start_with(&replay, &file).failure(2);
    assert!(!log.contains("options from"), "{log}");
    let convert = ["convert", "/missing.wire", "--to=csv"];
    let log = Bridge::start_with(&convert, &file).failure(2);
    assert!(log.contains("model"), "the model of the file: {log}");
}
