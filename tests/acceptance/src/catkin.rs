//! Catkin workspaces that tests make and build as a user of ROS Noetic does.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use emulator::skip::skip_unless_required;

use crate::ros::{self, Ros};
use crate::workspace;

/// Files that must exist to build the catkin packages, and the Debian package that installs each.
const NEEDED: [(&str, &str); 5] = [
    ("/usr/bin/catkin_make", "catkin"),
    ("/usr/bin/rosrun", "rosbash"),
    ("/usr/share/message_generation/package.xml", "ros-message-generation"),
    ("/usr/share/message_runtime/package.xml", "ros-message-runtime"),
    ("/usr/share/std_msgs/msg/Header.msg", "ros-std-msgs"),
];

/// Returns whether ROS and catkin are installed; reports `test` as skipped if they are not.
///
/// # Panics
/// When ROS or catkin is not installed and `CORTICODE_REQUIRE_ROS=1`.
pub fn available(test: &str) -> bool {
    let missing: Vec<&str> = NEEDED
        .into_iter()
        .filter(|(file, _)| !Path::new(file).exists())
        .map(|(_, package)| package)
        .collect();
    if missing.is_empty() {
        return ros::available(test);
    }
    let why = format!("missing: `apt-get install {}`", missing.join(" "));
    skip_unless_required(test, why);
    false
}

/// Returns the folder of one of the project's catkin packages.
///
/// # Panics
/// When the package does not exist.
pub fn package(name: &str) -> PathBuf {
    let folder = workspace::root().join("ros").join(name);
    folder.canonicalize().expect("a catkin package")
}

/// A catkin workspace: a folder with `src` and, once it is built, `devel` and `install`.
#[derive(Debug)]
pub struct CatkinWorkspace {
    folder: PathBuf,
}

impl CatkinWorkspace {
    /// Makes a workspace in the new folder `folder`; its `src` links to the folders in `packages`.
    ///
    /// # Panics
    /// When the folder cannot be written.
    pub fn new(folder: PathBuf, packages: &[PathBuf]) -> Self {
        let sources = folder.join("src");
        fs::create_dir_all(&sources).expect("a folder");
        for package in packages {
            let name = package.file_name().expect("a package's folder");
            symlink(package, sources.join(name)).expect("a link");
        }
        Self { folder }
    }

    /// Runs `catkin_make ARGUMENTS` in this workspace. The build finds Debian's packages and, if
    /// `below` is given, also those built in that workspace.
    ///
    /// # Panics
    /// When catkin_make does not start.
    pub fn make(&self, ros: &Ros<'_>, below: Option<&Self>, arguments: &[&str]) -> Output {
        let mut make = match below {
            Some(below) => below.command(ros, "devel", "catkin_make"),
            None => ros.command("catkin_make"),
        };
        make.current_dir(&self.folder).args(arguments).output().expect("catkin_make starts")
    }

    /// Returns a command that runs `program` in the environment that this workspace's script
    /// `SPACE/setup.sh` sets up; `space` is `devel` or `install`.
    pub fn command(&self, ros: &Ros<'_>, space: &str, program: &str) -> Command {
        let setup = self.folder.join(space).join("setup.sh");
        let mut shell = ros.command("sh");
        shell
            .env_remove("PYTHONPATH")
            .args(["-c", ". \"$0\"; exec \"$@\""])
            .arg(setup)
            .arg(program);
        shell
    }

    /// Runs `words`, a program and its arguments, in the environment of `space`, which is `devel`
    /// or `install`. Returns the program's standard output.
    ///
    /// # Panics
    /// When the program does not start or fails.
    pub fn tool(&self, ros: &Ros<'_>, space: &str, words: &str) -> String {
        let mut words = words.split(' ');
        let program = words.next().expect("a program");
        let output = self.command(ros, space, program).args(words).output();
        text_of(&output.expect("the tool starts"))
    }
}

/// Returns the standard output of a finished program, which must have succeeded.
///
/// # Panics
/// When the program has failed; the message contains its output.
pub fn text_of(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}\n{errors}");
    text
}
