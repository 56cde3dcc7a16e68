//! The workspace's programs, as a user runs them.

use std::env;
use std::path::PathBuf;
use std::sync::OnceLock;

use crate::workspace::cargo;

/// Paths of the programs that tests start.
#[derive(Debug, Clone)]
pub struct Programs {
    /// `host-sim`, the virtual board.
    pub host_sim: PathBuf,
    /// `corticode-bridge`, the bridge from a board to ROS.
    pub bridge: PathBuf,
}

/// Environment variable with the folder of programs that are built already.
const FOLDER: &str = "CORTICODE_PROGRAMS";

/// Finds the programs in the folder named by `CORTICODE_PROGRAMS`, or else builds them with the profile of the
/// tests, once per test program.
///
/// # Panics
/// When a program does not build.
pub fn programs() -> &'static Programs {
    static PROGRAMS: OnceLock<Programs> = OnceLock::new();
    PROGRAMS.get_or_init(|| {
        if let Some(folder) = env::var_os(FOLDER).map(PathBuf::from) {
            return Programs {
                host_sim: folder.join("host-sim"),
                bridge: folder.join("corticode-bridge"),
            };
        }
        // Build all default members, as `cargo test` does: another choice of packages can have other features, and
        // everything would be compiled a second time.
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

/// Path of a program in cargo's JSON messages of a build.
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
