//! The images that are flashed, on emulated boards behind a TCP port.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::process::Process;
use crate::programs::executable;
use crate::skip::skipped;
use crate::workspace::{cargo, root};

/// The toolchain that the emulated boards are built with: the channel in their rust-toolchain.toml.
fn toolchain() -> &'static str {
    let file = include_str!("../virtual-board/rust-toolchain.toml");
    let channel = file.split("channel = \"").nth(1).expect("a channel");
    channel.split('"').next().expect("its end")
}

/// The microcontroller's target.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Whether the emulated boards can be built; says loudly that `test` is skipped when they cannot.
///
/// # Panics
/// When they cannot and `CORTICODE_REQUIRE_ROS=1`.
pub fn available(test: &str) -> bool {
    let mut version = Command::new("rustup");
    version.args(["run", toolchain(), "cargo", "--version"]);
    let silent = version.stdout(Stdio::null()).stderr(Stdio::null());
    if silent.status().is_ok_and(|status| status.success()) {
        return true;
    }
    let channel = toolchain();
    let why = format!("no Rust {channel}; `rustup toolchain install {channel} --profile minimal`");
    let required = env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(
        !required,
        "{test}: CORTICODE_REQUIRE_ROS=1, and there is {why}"
    );
    skipped(test, &why);
    false
}

/// A board by its word, `h743` or `f446`, with its default image.
#[derive(Debug, Clone)]
pub struct Board {
    word: &'static str,
    program: PathBuf,
    image: PathBuf,
}

impl Board {
    /// Builds the emulated board and its image, with the profile that `cargo flash` builds with.
    ///
    /// # Panics
    /// When one of them does not build.
    pub fn build(word: &'static str) -> Self {
        let package = format!("board-{word}");
        let messages = cargo(&[
            "build",
            "--package",
            &package,
            "--profile=firmware",
            &format!("--target={TARGET}"),
            "--message-format=json",
        ]);
        let image = executable(&messages.expect("the image builds"), &package);
        // Beside the images' target folder, where `cargo xtask board` builds it, too.
        let target = image.ancestors().nth(3).expect("a target folder");
        let output = Command::new("rustup")
            .args(["run", toolchain(), "cargo", "build", "--release"])
            .arg("--message-format=json")
            .current_dir(root().join("tests/virtual-board"))
            .env("CARGO_TARGET_DIR", target.join("virtual-board"))
            .stderr(Stdio::inherit())
            .output()
            .expect("rustup starts");
        assert!(output.status.success(), "the emulated boards build");
        let messages = String::from_utf8_lossy(&output.stdout);
        Self {
            word,
            program: executable(&messages, "virtual-board"),
            image,
        }
    }

    /// Starts it at a TCP port of 127.0.0.1: in real time, or as fast as this machine can.
    ///
    /// # Panics
    /// When it does not start.
    pub fn start(&self, port: u16, folder: &Path) -> Process {
        let mut board = Command::new(&self.program);
        board
            .arg(self.word)
            .arg("--image")
            .arg(&self.image)
            .args(["--port", &port.to_string()]);
        Process::start("board", &mut board, folder).expect("the emulated board starts")
    }
}
