//! Installs what `cargo xtask test` needs and this user may install: Debian packages, Python
//! packages and parts of Rust.

use std::path::Path;
use std::process::Command;

use crate::command::{BOARD_TARGET, Failure, run, succeeds, typed, virtual_board_toolchain};
use crate::wheels;

/// Debian packages that provide ROS 1 (roscore, rospy, rostopic, rosservice, rosbag), the service
/// types of the node `acquisition`, numpy for tests that read arrays, the library with which
/// ROS-Neuro's recorder writes GDF, the emulator of the microcontrollers, udev with a testbed that
/// simulates devices, the formatter of manual pages, a browser with its remote control, the
/// compiler that checks the types of the live page's scripts, the tools to build the catkin
/// packages in `ros/` and the Debian package, a clean Debian and a systemd to check that package,
/// and Python's environments.
const PACKAGES: [&str; 24] = [
    "ros-core",
    "python3-std-srvs",
    "python3-numpy",
    "libxdffileio0",
    "qemu-system-arm",
    "udev",
    "umockdev",
    "catkin",
    "g++",
    "make",
    "rosbash",
    "ros-message-generation",
    "ros-message-runtime",
    "ros-std-msgs",
    "libstd-msgs-dev",
    "binutils",
    "dpkg-dev",
    "mmdebstrap",
    "systemd",
    "groff-base",
    "chromium",
    "chromium-driver",
    "node-typescript",
    "python3-venv",
];

/// Option of apt-get: seconds to wait while another program installs packages.
const WAIT: &str = "DPkg::Lock::Timeout=600";

/// Installs whatever `cargo xtask test` needs and this machine lacks.
pub(crate) fn install() -> Result<(), Failure> {
    board_target()?;
    virtual_board_compiler()?;
    debian_packages()?;
    wheels::install()
}

/// Adds Rust's standard library for the microcontrollers, if it is missing.
pub(crate) fn board_target() -> Result<(), Failure> {
    // Ask the compiler whether it has the target. Do not ask rustup, because a Rust from a Linux
    // distribution comes without it.
    let mut rustc = Command::new("rustc");
    let folder = rustc.args(["--print=target-libdir", "--target", BOARD_TARGET]).output();
    if folder.is_ok_and(|output| Path::new(String::from_utf8_lossy(&output.stdout).trim()).is_dir())
    {
        return Ok(());
    }
    rustup(
        &format!("target add {BOARD_TARGET}"),
        &format!("the standard library for {BOARD_TARGET}"),
    )
}

/// Installs the Rust toolchain of the emulated boards if it is missing, because not every rustup
/// installs a toolchain on first use.
pub(crate) fn virtual_board_compiler() -> Result<(), Failure> {
    let version = virtual_board_toolchain();
    if succeeds(Command::new("rustup").args(["run", version, "cargo", "clippy", "--version"])) {
        return Ok(());
    }
    rustup(
        &format!("toolchain install {version} --profile minimal --component clippy"),
        &format!("Rust {version}, which the emulated boards are built with"),
    )
}

fn rustup(words: &str, what: &str) -> Result<(), Failure> {
    let mut command = Command::new("rustup");
    command.args(words.split(' '));
    run(&mut command, "").map_err(|_| {
        let why = "rustup is missing, or did not install it";
        Failure::missing(what, why, typed(&command))
    })
}

fn debian_packages() -> Result<(), Failure> {
    let is_missing = |name: &&str| !is_installed(name);
    let missing: Vec<&str> = PACKAGES.into_iter().filter(is_missing).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let script = script(&missing);
    let id = Command::new("id").arg("-u").output();
    let mut shell = if id.is_ok_and(|output| output.stdout == b"0\n") {
        Command::new("sh")
    } else {
        let mut sudo = Command::new("sudo");
        sudo.args(["-n", "sh"]);
        sudo
    };
    run(shell.args(["-c", &script]), "").map_err(|_| refusal(&missing))
}

/// Returns a shell script that installs `packages` with apt-get.
fn script(packages: &[&str]) -> String {
    // Set apt-get to noninteractive, because a package's question would block a run without a
    // terminal. Update first, because a fresh machine has no package lists, without which apt-get
    // installs nothing. Only `install` can wait for another program, so repeat `update` for ten
    // minutes at most.
    let install = apt_get_install(packages);
    format!(
        "export DEBIAN_FRONTEND=noninteractive LC_ALL=C
        tries=120
        while apt-get update 2>&1 | tee /dev/stderr | grep 'Could not get lock' >/dev/null &&
            [ $((tries -= 1)) -gt 0 ]
        do sleep 5
        done
        {install}"
    )
}

fn apt_get_install(packages: &[&str]) -> String {
    let packages = packages.join(" ");
    format!("apt-get -o {WAIT} install --yes --no-install-recommends {packages}")
}

fn refusal(missing: &[&str]) -> Failure {
    let why = "installing it failed as above; it needs Debian's apt-get, and root or sudo without a password";
    let line = apt_get_install(missing);
    let next = format!("`sudo {line}` (or `cargo xtask test --fast`, which does without)");
    Failure::missing(missing.join(", "), why, next)
}

fn is_installed(package: &str) -> bool {
    let mut query = Command::new("dpkg-query");
    let query = query.args(["--show", "--showformat=${Status}", package]).output();
    query.is_ok_and(|output| output.stdout.ends_with(b"ok installed"))
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn the_refusal_is_one_line_to_run() {
        let text = refusal(&["ros-core", "python3-numpy"]).message;
        let line = "`sudo apt-get -o DPkg::Lock::Timeout=600 install --yes --no-install-recommends \
                    ros-core python3-numpy`";
        assert!(text.contains(line), "{text}");
        assert!(!is_installed("corticode-no-such-package"));
    }

    #[test]
    fn a_busy_package_database_is_waited_for() {
        let folder = std::env::temp_dir().join(format!("xtask-apt-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        // Fake apt-get whose first two updates fail, as if another program updated the lists.
        let apt_get = "#!/bin/sh
            cd \"$(dirname \"$0\")\"
            echo \"$*\" >>calls
            [ \"$1\" != update ] || [ \"$(grep -c update calls)\" = 3 ] && exit
            echo 'E: Could not get lock /var/lib/apt/lists/lock.' >&2
            exit 100";
        for (name, text) in [("apt-get", apt_get), ("sleep", "#!/bin/sh")] {
            let path = folder.join(name);
            fs::write(&path, text).expect("a file");
            fs::set_permissions(path, Permissions::from_mode(0o755)).expect("a program");
        }
        let path = format!("{}:/usr/bin:/bin", folder.display());
        let mut shell = Command::new("sh");
        let shell = shell.args(["-c", &script(&["make"])]).env("PATH", path);
        let installed = shell.output().expect("a shell");
        let calls = fs::read_to_string(folder.join("calls")).expect("the calls");
        fs::remove_dir_all(&folder).expect("the folder");
        assert!(installed.status.success(), "{installed:?}");
        let expected = "update\nupdate\nupdate\n\
                        -o DPkg::Lock::Timeout=600 install --yes --no-install-recommends make\n";
        assert_eq!(calls, expected);
    }
}
