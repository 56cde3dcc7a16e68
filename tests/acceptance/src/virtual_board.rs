//! Virtual boards with a TCP port, which run the firmware images of the NUCLEO boards.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use emulator::Image;
use emulator::skip::skip_unless_required;

use crate::process::Process;
use crate::programs::executable;
use crate::workspace::root;

/// Returns the Rust toolchain of the virtual boards, from `rust-toolchain.toml` in their workspace.
fn toolchain() -> &'static str {
    let file = include_str!("../../virtual-board/rust-toolchain.toml");
    let channel = file.split("channel = \"").nth(1).expect("a channel");
    channel.split('"').next().expect("its end")
}

/// Returns whether the toolchain of the virtual boards is installed; reports `test` as skipped if
/// it is not.
///
/// # Panics
/// When the toolchain is not installed and `CORTICODE_REQUIRE_ROS=1`.
pub fn available(test: &str) -> bool {
    let mut version = Command::new("rustup");
    version.args(["run", toolchain(), "cargo", "--version"]);
    let silent = version.stdout(Stdio::null()).stderr(Stdio::null());
    if silent.status().is_ok_and(|status| status.success()) {
        return true;
    }
    let channel = toolchain();
    let why = format!("no Rust {channel}; `rustup toolchain install {channel} --profile minimal`");
    skip_unless_required(test, why);
    false
}

/// A built virtual board and the image that it runs.
#[derive(Debug, Clone)]
pub struct Board {
    /// Name of the board: `h743` or `f446`.
    name: &'static str,
    program: PathBuf,
    image: Image,
}

impl Board {
    /// Builds the virtual board `name`, which is `h743` or `f446`, and its default image, with the
    /// profile of `cargo flash`.
    ///
    /// # Panics
    /// When the board or its image does not build.
    pub fn build(name: &'static str) -> Self {
        let package = format!("board-{name}");
        let image = Image::build(&package, &package, &[]);
        let image = image.unwrap_or_else(|error| panic!("{error}"));
        // Share the target folder with `cargo xtask board`, so that the board is built once.
        let target = image.create_folder("virtual-board");
        let output = Command::new("rustup")
            .args(["run", toolchain(), "cargo", "build", "--release"])
            .arg("--message-format=json")
            .current_dir(root().join("tests/virtual-board"))
            .env("CARGO_TARGET_DIR", target.expect("a folder"))
            .stderr(Stdio::inherit())
            .output()
            .expect("rustup starts");
        assert!(output.status.success(), "the virtual boards build");
        let messages = String::from_utf8_lossy(&output.stdout);
        Self {
            name,
            program: executable(&messages, "virtual-board"),
            image,
        }
    }

    /// Starts the board with TCP port `port` on 127.0.0.1. It runs in real time, or slower if this
    /// machine is not fast enough.
    ///
    /// # Panics
    /// When the board does not start.
    pub fn start(&self, port: u16, folder: &Path) -> Process {
        let mut board = Command::new(&self.program);
        board
            .arg(self.name)
            .arg("--image")
            .arg(self.image.path())
            .args(["--port", &port.to_string()]);
        Process::start("board", &mut board, folder).expect("the virtual board starts")
    }
}
