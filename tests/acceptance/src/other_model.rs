//! Builds with another model than the checked-in one.

use std::{
    env,
    path::{Path, PathBuf},
    process::Command,
};

use crate::workspace;

/// Returns cargo in the workspace, which builds with the model in `artifact` into [`target`].
pub fn cargo(artifact: &Path) -> Command {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo
        .current_dir(workspace::root())
        .env("CORTICODE_ARTIFACT", artifact)
        .env("CARGO_TARGET_DIR", target());
    cargo
}

/// Returns the target folder of builds with other models. In the usual one, each change of the model would
/// rebuild the crates that depend on it twice.
///
/// # Panics
/// When this program is not in a target folder of cargo.
pub fn target() -> PathBuf {
    let this = env::current_exe().expect("this program has a path");
    let profile = this.ancestors().nth(2).expect("target/profile/deps/test");
    profile.parent().expect("a target folder").join("variants")
}
