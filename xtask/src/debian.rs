//! Debian packages that the acceptance and the benchmark need, installed where we may.

use std::path::Path;
use std::process::Command;

use crate::benchmark::emulator;
use crate::command::{run, succeeds, typed};
use crate::failure::Failure;

/// ROS 1 with roscore, rospy, rostopic, rosservice and rosbag; the services of `acquisition`; what
/// the Python side reads arrays with; and the emulated microcontroller.
const PACKAGES: [&str; 4] = [
    "ros-core",
    "python3-std-srvs",
    "python3-numpy",
    emulator::PACKAGE,
];

/// Makes sure that the packages are there.
///
/// # Errors
/// [`Failure::Missing`] with the one line that installs them, where we may not or cannot.
pub(crate) fn ensure() -> Result<(), Failure> {
    let missing: Vec<&str> = PACKAGES
        .into_iter()
        .filter(|name| !installed(name))
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
    let Some(words) = privilege() else {
        return Err(refusal(
            &missing,
            "we are not root, and sudo asks for a password",
        ));
    };
    if run(&mut install(words, &missing), "").is_ok() {
        return Ok(());
    }
    // A fresh machine has no package lists yet.
    run(
        &mut apt_get(words, &["update"]),
        "check the network and /etc/apt/sources.list",
    )?;
    run(&mut install(words, &missing), "")
        .map_err(|failure| refusal(&missing, &failure.to_string()))
}

/// Words before `apt-get`: none for root, `sudo -n` where it works without a password.
fn privilege() -> Option<&'static [&'static str]> {
    if rustix::process::geteuid().is_root() {
        Some(&["env"])
    } else if succeeds(Command::new("sudo").args(["-n", "true"])) {
        Some(&["sudo", "-n", "env"])
    } else {
        None
    }
}

fn install(words: &[&str], packages: &[&str]) -> Command {
    let mut command = apt_get(words, &["install", "--yes", "--no-install-recommends"]);
    command.args(packages);
    command
}

fn apt_get(words: &[&str], arguments: &[&str]) -> Command {
    let mut command = Command::new(words[0]);
    // Without a terminal a question would wait for ever.
    command
        .args(&words[1..])
        .arg("DEBIAN_FRONTEND=noninteractive")
        .arg("apt-get")
        .args(arguments);
    command
}

fn installed(package: &str) -> bool {
    let query = Command::new("dpkg-query")
        .args(["--show", "--showformat=${Status}", package])
        .output();
    query.is_ok_and(|output| output.stdout.ends_with(b"ok installed"))
}

fn refusal(missing: &[&str], why: &str) -> Failure {
    Failure::Missing {
        what: missing.join(", "),
        why: why.to_owned(),
        next: format!(
            "`{}` (or `cargo xtask test --fast`, which does without)",
            install_line(missing)
        ),
    }
}

/// What a person types to install packages.
pub(crate) fn install_line(packages: &[&str]) -> String {
    typed(&install(&["sudo", "env"], packages)).replace("env DEBIAN_FRONTEND=noninteractive ", "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_refusal_is_one_line_to_run() {
        let text = refusal(&["ros-core", "python3-numpy"], "a reason").to_string();
        let line = "`sudo apt-get install --yes --no-install-recommends ros-core python3-numpy`";
        assert!(text.contains(line), "{text}");
    }

    #[test]
    fn a_package_nobody_made_is_not_installed() {
        assert!(!installed("corticode-no-such-package"));
    }
}
