//! Our programs as a user runs them.

use std::path::PathBuf;
use std::sync::OnceLock;

use crate::workspace::cargo;

/// Where the programs lie.
#[derive(Debug, Clone)]
pub struct Programs {
    /// The virtual board.
    pub host_sim: PathBuf,
    /// The bridge to ROS.
    pub bridge: PathBuf,
}

/// Builds them, once per test program, with the profile that the tests have.
///
/// # Panics
/// When they do not build.
pub fn programs() -> &'static Programs {
    static PROGRAMS: OnceLock<Programs> = OnceLock::new();
    PROGRAMS.get_or_init(|| {
        // All default members, as `cargo test` builds them: another choice of packages would have
        // other features, and everything would be compiled a second time.
        let mut arguments = vec!["build", "--bins", "--message-format=json"];
        if !cfg!(debug_assertions) {
            arguments.push("--release");
        }
        let messages = cargo(&arguments).expect("host-sim and corticode-bridge build");
        Programs {
            host_sim: executable(&messages, "host-sim"),
            bridge: executable(&messages, "corticode-bridge"),
        }
    })
}

/// Path of a program in what cargo says about a build.
pub(crate) fn executable(messages: &str, name: &str) -> PathBuf {
    let mut built = messages.lines().filter_map(|line| {
        let message: serde_json::Value = serde_json::from_str(line).ok()?;
        let is_it = message["target"]["name"] == name;
        is_it.then(|| message["executable"].as_str().map(PathBuf::from))?
    });
    built
        .next_back()
        .unwrap_or_else(|| panic!("cargo built no `{name}`"))
}
