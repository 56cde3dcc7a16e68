//! The workspace's programs, which tests start as a user does.

use std::env;
use std::path::PathBuf;
use std::sync::OnceLock;

use emulator::skip::skip_unless_required;

use crate::workspace::cargo;

/// Paths of the workspace's programs that tests start.
#[derive(Debug, Clone)]
pub struct Programs {
    /// Path of `host-sim`, which simulates a board.
    pub host_sim: PathBuf,
    /// Path of `corticode-bridge`, which publishes on ROS what a board sends.
    pub bridge: PathBuf,
    /// Path of `corticode-node`, which encodes EEG frames that another ROS node publishes.
    pub node: PathBuf,
    /// Path of `xtask`, which carries out `cargo xtask`.
    pub xtask: PathBuf,
}

/// Environment variable that names the folder in which tests find built programs.
const FOLDER: &str = "CORTICODE_PROGRAMS";

/// Returns the programs in the folder that `CORTICODE_PROGRAMS` names. Without this variable, the
/// first call builds them with the profile of the tests.
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
                node: folder.join("corticode-node"),
                xtask: folder.join("xtask"),
            };
        }
        // Build all default members, as `cargo test` does: for a smaller choice of packages, cargo
        // may enable other features and compile everything again.
        let mut arguments = vec!["build", "--bins", "--message-format=json"];
        if !cfg!(debug_assertions) {
            arguments.push("--release");
        }
        let messages = cargo(&arguments).expect("host-sim and corticode-bridge build");
        Programs {
            host_sim: executable(&messages, "host-sim"),
            bridge: executable(&messages, "corticode-bridge"),
            node: executable(&messages, "corticode-node"),
            xtask: executable(&messages, "xtask"),
        }
    })
}

/// Returns the path of the program `trainer`: in the folder that `CORTICODE_PROGRAMS` names or,
/// without this variable, where cargo builds it with the tests' profile. It is not built here,
/// because that takes minutes; if it is missing, reports the test `what` as skipped.
///
/// # Panics
/// When the program is missing and `CORTICODE_REQUIRE_ROS=1`.
pub fn trainer(what: &str) -> Option<PathBuf> {
    let folder = env::var_os(FOLDER).map(PathBuf::from).or_else(|| {
        let this = env::current_exe().ok()?;
        this.ancestors().nth(2).map(PathBuf::from)
    });
    let path = folder?.join("trainer");
    if !path.exists() {
        skip_unless_required(what, "no trainer; `cargo build --package trainer` builds it");
        return None;
    }
    Some(path)
}

/// Returns the path of the program `name`, as the JSON messages of cargo's build report it.
fn executable(messages: &str, name: &str) -> PathBuf {
    let mut built = messages.lines().filter_map(|line| {
        let message: serde_json::Value = serde_json::from_str(line).ok()?;
        let is_it = message["target"]["name"] == name;
        is_it.then(|| message["executable"].as_str().map(PathBuf::from))?
    });
    built.next_back().unwrap_or_else(|| panic!("cargo built no `{name}`"))
}
