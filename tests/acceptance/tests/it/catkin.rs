//! The catkin packages build in workspaces with and without ROS-Neuro's own `rosneuro_msgs`, and
//! their launch files pass the command line's arguments on to the bridge and to corticode-node.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use acceptance::catkin::{self, CatkinWorkspace, text_of};
use acceptance::printing::board_with;
use acceptance::process::Process;
use acceptance::programs::programs;
use acceptance::ros::{Ros, TIMEOUT};
use neuro_ros::{GET_ACQUISITION_INFO, NeuroEvent, NeuroFrame, RosMessage};
use rustix::process::Signal;

/// Time limit for roslaunch to end its nodes and exit after a Unix signal.
const EXIT_TIMEOUT: Duration = Duration::from_mins(1);
/// Options of the bridge that are not arguments of corticode.launch: `exit_at_end`, which is for
/// scripts, `open_browser`, which needs a desktop, and `topic_prefix`, which the argument `ns`
/// replaces.
const NOT_ARGUMENTS: [&str; 3] = ["exit_at_end", "open_browser", "topic_prefix"];

#[test]
fn built_messages_have_the_md5_sums_that_the_bridge_publishes() {
    if !catkin::available("catkin packages with the project's messages") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let ros = Ros::start(folder.path()).expect("roscore starts");
    let packages = ["corticode", "rosneuro_msgs"].map(catkin::package);
    let workspace = CatkinWorkspace::new(folder.path().join("alone"), &packages);
    text_of(&workspace.make(&ros, None, &[&bridge_option()]));
    // Build again in the environment of the built workspace, as a user does: the build must not
    // mistake the workspace's own messages for another workspace's.
    text_of(&workspace.make(&ros, Some(&workspace), &["install"]));

    for space in ["devel", "install"] {
        for (tool, name, md5) in [
            ("rosmsg", NeuroFrame::TYPE.name, NeuroFrame::TYPE.md5),
            ("rosmsg", NeuroEvent::TYPE.name, NeuroEvent::TYPE.md5),
            ("rossrv", GET_ACQUISITION_INFO.name, GET_ACQUISITION_INFO.md5),
        ] {
            let built = workspace.tool(&ros, space, &format!("{tool} md5 {name}"));
            assert_eq!(built.trim(), md5, "{name} in {space}");
        }
        let version = workspace.tool(&ros, space, "rosrun corticode corticode-bridge --version");
        assert!(version.starts_with("corticode-bridge "), "{version}");
        let launch =
            workspace.tool(&ros, space, "roslaunch --files corticode record.launch port:=x");
        assert!(launch.contains("corticode.launch"), "{launch}");
    }
}

#[test]
fn roslaunch_starts_the_bridge_with_its_arguments_in_a_namespace() {
    if !catkin::available("roslaunch of the bridge") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let ros = Ros::start(folder.path()).expect("roscore starts");
    let packages = [catkin::package("corticode"), other_messages(folder.path())];
    let workspace = CatkinWorkspace::new(folder.path().join("rosneuro"), &packages);
    text_of(&workspace.make(&ros, None, &[&bridge_option()]));

    // The build must refuse the project's package, because it would hide a package of the same name
    // in the workspace below.
    let above = [catkin::package("rosneuro_msgs")];
    let above = CatkinWorkspace::new(folder.path().join("above"), &above);
    let refused = above.make(&ros, Some(&workspace), &[]);
    let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && errors.contains("already has rosneuro_msgs"), "{errors}");

    assert_every_option_is_an_argument(&workspace, &ros);

    let port = folder.path().join("board");
    let output = format!("pty:{}", port.display());
    let _board = board_with(folder.path(), &output, &["--realtime"]);
    let port = format!("port:={}", port.display());

    let arguments =
        ["corticode.launch", &port, "ns:=left", "announce:=reconstructed", "streams:=codes,raw"];
    let launched = launch(&workspace, &ros, folder.path(), &arguments);
    wait_for_frames(&workspace, &ros, folder.path(), "/left/encoded");
    assert_node_encodes(&workspace, &ros, folder.path(), "/left/neurodata");
    let info = workspace.tool(&ros, "devel", "rosservice call /left/acquisition/get_info");
    assert!(info.contains("result: True") && info.contains("nchannels: 61"), "{info}");
    let ended = launched.stop(Signal::INT, EXIT_TIMEOUT);
    assert!(ended.success(), "roslaunch on SIGINT: {ended}");

    let prefix = format!("prefix:={}/session", folder.path().display());
    let arguments = ["record.launch", &port, "ns:=right", &prefix];
    let launched = launch(&workspace, &ros, folder.path(), &arguments);
    wait_for_frames(&workspace, &ros, folder.path(), "/right/neurodata_reconstructed");
    let ended = launched.stop(Signal::INT, EXIT_TIMEOUT);
    assert!(ended.success(), "roslaunch on SIGINT: {ended}");
    let bag = bag_in(folder.path());
    let info = workspace.tool(&ros, "devel", &format!("rosbag info {}", bag.display()));
    for topic in [" /right/encoded", " /right/neurodata_reconstructed", " /diagnostics"] {
        assert!(info.contains(topic), "no {topic} in {info}");
    }
}

/// Starts corticode-node by its launch file, and checks that it encodes the EEG frames of `topic`.
fn assert_node_encodes(workspace: &CatkinWorkspace, ros: &Ros<'_>, folder: &Path, topic: &str) {
    let input = format!("input:={topic}");
    let launched = launch(workspace, ros, folder, &["node.launch", &input, "mains:=60"]);
    wait_for_frames(workspace, ros, folder, "/encoded");
    let info = workspace.tool(ros, "devel", "rosservice call /corticode/get_info");
    assert!(info.contains("corticode-node") && info.contains("60 Hz"), "{info}");
    let ended = launched.stop(Signal::INT, EXIT_TIMEOUT);
    assert!(ended.success(), "roslaunch on SIGINT: {ended}");
}

#[test]
fn a_build_without_the_program_says_where_to_get_it() {
    if !catkin::available("catkin package without the bridge") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let ros = Ros::start(folder.path()).expect("roscore starts");
    let packages = [catkin::package("corticode")];
    let workspace = CatkinWorkspace::new(folder.path().join("empty"), &packages);
    let missing = "-DCORTICODE_BRIDGE=/no/such/corticode-bridge";
    let refused = workspace.make(&ros, None, &[missing]);
    let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success(), "{errors}");
    for words in ["/no/such/corticode-bridge", "Debian package", "cargo install"] {
        assert!(errors.contains(words), "no {words:?} in {errors}");
    }
}

/// Checks that corticode.launch has every private parameter of the bridge but [`NOT_ARGUMENTS`].
fn assert_every_option_is_an_argument(workspace: &CatkinWorkspace, ros: &Ros<'_>) {
    // The bridge lists its private parameters when it refuses an unknown one.
    let refused = Command::new(&programs().bridge)
        .arg("_no_such_parameter:=1")
        .output()
        .expect("the bridge starts");
    let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
    let (_, known) = errors.split_once("known are ").expect(&errors);
    let known = known.lines().next().expect("one line");
    let mut expected: BTreeSet<&str> = known.split(", ").collect();
    for name in NOT_ARGUMENTS {
        assert!(expected.remove(name), "{name} is no parameter of the bridge: {known}");
    }
    let listed = workspace.tool(ros, "devel", "roslaunch --ros-args corticode corticode.launch");
    let arguments: BTreeSet<&str> = listed
        .lines()
        .filter_map(|line| line.strip_prefix("  ")?.split([' ', ':']).next())
        .collect();
    let missing: Vec<_> = expected.difference(&arguments).collect();
    assert!(missing.is_empty(), "corticode.launch lacks {missing:?}:\n{listed}");
}

/// Returns a package `rosneuro_msgs` that stands for ROS-Neuro's own: it has the project's
/// definitions and one more message.
fn other_messages(folder: &Path) -> PathBuf {
    let ours = catkin::package("rosneuro_msgs");
    let other = folder.join("ros-neuro/rosneuro_msgs");
    for kind in ["msg", "srv"] {
        fs::create_dir_all(other.join(kind)).expect("a folder");
        for file in fs::read_dir(ours.join(kind)).expect("the definitions") {
            let file = file.expect("a file").path();
            let copy = other.join(kind).join(file.file_name().expect("a name"));
            fs::copy(&file, copy).expect("a copy");
        }
    }
    fs::write(other.join("msg/NeuroOther.msg"), "float32 value\n").expect("a message");
    fs::copy(ours.join("package.xml"), other.join("package.xml")).expect("a copy");
    let list = "cmake_minimum_required(VERSION 3.10)\n\
        project(rosneuro_msgs)\n\
        find_package(catkin REQUIRED COMPONENTS message_generation std_msgs)\n\
        add_message_files(DIRECTORY msg)\n\
        add_service_files(DIRECTORY srv)\n\
        generate_messages(DEPENDENCIES std_msgs)\n\
        catkin_package(CATKIN_DEPENDS message_runtime std_msgs)\n";
    fs::write(other.join("CMakeLists.txt"), list).expect("a file");
    other
}

fn bridge_option() -> String {
    format!("-DCORTICODE_BRIDGE={}", programs().bridge.display())
}

fn launch(
    workspace: &CatkinWorkspace,
    ros: &Ros<'_>,
    folder: &Path,
    arguments: &[&str],
) -> Process {
    let mut roslaunch = workspace.command(ros, "devel", "roslaunch");
    roslaunch.arg("corticode").args(arguments);
    Process::start(arguments[0], &mut roslaunch, folder).expect("roslaunch starts")
}

/// Waits until rostopic, which uses the workspace's message classes, has received 32 NeuroFrames of
/// `topic`. This takes 2 s; meanwhile, rosbag also records a status on /diagnostics.
fn wait_for_frames(workspace: &CatkinWorkspace, ros: &Ros<'_>, folder: &Path, topic: &str) {
    let mut echo = workspace.command(ros, "devel", "rostopic");
    echo.args(["echo", "-n32", topic]);
    let mut echo = Process::start("echo", &mut echo, folder).expect("rostopic starts");
    let ended = echo.wait(TIMEOUT);
    let frame = echo.output();
    assert!(ended.success() && frame.contains("nchannels: "), "{}", echo.log());
}

fn bag_in(folder: &Path) -> PathBuf {
    let entries = fs::read_dir(folder).expect("the folder");
    let mut bags = entries
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "bag"));
    bags.next().expect("a closed bag")
}
