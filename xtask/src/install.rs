//! Debian packages and parts of Rust that `test` needs, installed if this user is allowed to.

use std::fmt::Display;
use std::path::Path;
use std::process::Command;

use crate::command::{BOARD_TARGET, Failure, run, succeeds, typed, virtual_board_toolchain};

/// Debian packages: ROS 1 with roscore, rospy, rostopic, rosservice and rosbag; the service types of the node
/// `acquisition`; numpy, with which tests read arrays; the emulator of the microcontrollers.
const PACKAGES: [&str; 4] = [
    "ros-core",
    "python3-std-srvs",
    "python3-numpy",
    "qemu-system-arm",
];

/// Installs everything that `test` needs and that is missing.
///
/// # Errors
/// Something is missing and cannot be installed; the message has the line that installs it.
pub(crate) fn install() -> Result<(), Failure> {
    board_target()?;
    virtual_board_compiler()?;
    debian_packages()
}

/// Adds Rust's standard library for the microcontrollers.
///
/// # Errors
/// It is missing, and rustup cannot add it.
pub(crate) fn board_target() -> Result<(), Failure> {
    // Ask the compiler, not rustup: a Rust from a Linux distribution has no rustup.
    let mut rustc = Command::new("rustc");
    let folder = rustc
        .args(["--print=target-libdir", "--target", BOARD_TARGET])
        .output();
    let folder = folder.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    if folder.is_ok_and(|folder| Path::new(&folder).is_dir()) {
        return Ok(());
    }
    rustup(
        &["target", "add", BOARD_TARGET],
        &format!("the standard library for {BOARD_TARGET}"),
    )
}

/// Installs the Rust toolchain of the emulated boards, because rustup on many machines does not install it on
/// first use.
///
/// # Errors
/// It is missing, and rustup cannot install it.
pub(crate) fn virtual_board_compiler() -> Result<(), Failure> {
    let version = virtual_board_toolchain();
    if succeeds(Command::new("rustup").args(["run", version, "cargo", "clippy", "--version"])) {
        return Ok(());
    }
    let words = [
        "toolchain",
        "install",
        version,
        "--profile",
        "minimal",
        "--component",
        "clippy",
    ];
    rustup(
        &words,
        &format!("Rust {version}, which the emulated boards are built with"),
    )
}

fn rustup(words: &[&str], what: &str) -> Result<(), Failure> {
    let mut command = Command::new("rustup");
    let line = format!("`{}`", typed(command.args(words)));
    run(&mut command, "").map_err(|failure| Failure::missing(what, failure, line))
}

fn debian_packages() -> Result<(), Failure> {
    let missing: Vec<&str> = PACKAGES
        .into_iter()
        .filter(|name| !is_installed(name))
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    if !Path::new("/usr/bin/apt-get").exists() {
        return Err(refusal(
            &missing,
            "this is no Debian or Ubuntu (no /usr/bin/apt-get)",
        ));
    }
    let id = Command::new("id").arg("-u").output();
    let prefix: &[&str] = if id.is_ok_and(|output| output.stdout == b"0\n") {
        &["env"]
    } else if succeeds(Command::new("sudo").args(["-n", "true"])) {
        &["sudo", "-n", "env"]
    } else {
        return Err(refusal(
            &missing,
            "this user is not root, and sudo asks for a password",
        ));
    };
    if run(&mut apt_get_install(prefix, &missing), "").is_ok() {
        return Ok(());
    }
    // A fresh machine has no package lists, and apt-get needs them to install anything.
    let next = "check the network and /etc/apt/sources.list";
    run(&mut apt_get(prefix, &["update"]), next)?;
    run(&mut apt_get_install(prefix, &missing), "").map_err(|failure| refusal(&missing, failure))
}

fn apt_get_install(prefix: &[&str], packages: &[&str]) -> Command {
    let options = ["install", "--yes", "--no-install-recommends"];
    apt_get(prefix, &[&options, packages].concat())
}

fn apt_get(prefix: &[&str], words: &[&str]) -> Command {
    let mut command = Command::new(prefix[0]);
    // Noninteractive, because without a terminal a question from a package would block the run.
    let apt_get = ["DEBIAN_FRONTEND=noninteractive", "apt-get"];
    command.args(&prefix[1..]).args(apt_get).args(words);
    command
}

fn is_installed(package: &str) -> bool {
    let mut query = Command::new("dpkg-query");
    let query = query
        .args(["--show", "--showformat=${Status}", package])
        .output();
    query.is_ok_and(|output| output.stdout.ends_with(b"ok installed"))
}

fn refusal(missing: &[&str], why: impl Display) -> Failure {
    let line = typed(&apt_get_install(&["sudo", "env"], missing));
    let line = line.replace("env DEBIAN_FRONTEND=noninteractive ", "");
    let next = format!("`{line}` (or `cargo xtask test --fast`, which does without)");
    Failure::missing(missing.join(", "), why, next)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_refusal_is_one_line_to_run() {
        let text = refusal(&["ros-core", "python3-numpy"], "a reason").to_string();
        let line = "`sudo apt-get install --yes --no-install-recommends ros-core python3-numpy`";
        assert!(text.contains(line), "{text}");
        assert!(!is_installed("corticode-no-such-package"));
    }
}
