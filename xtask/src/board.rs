//! `cargo xtask board`: the images that are flashed, on emulated boards.

mod images;
mod report;

use std::path::PathBuf;
use std::process::Command;
use std::sync::LazyLock;

use clap::{Args, ValueEnum};

use self::images::{Images, PROGRAM};
use crate::command::{root, run, succeeds, typed};
use crate::failure::Failure;

/// The toolchain that builds the emulated boards: their emulator needs a newer Rust than the rest.
static TOOLCHAIN: LazyLock<String> = LazyLock::new(|| {
    let file = include_str!("../../tests/virtual-board/rust-toolchain.toml");
    let channel = file.split("channel = \"").nth(1);
    let channel = channel.and_then(|rest| rest.split('"').next());
    channel.unwrap_or("stable").to_owned()
});

/// What the verb can be told.
#[derive(Debug, Clone, Args)]
pub(crate) struct BoardOptions {
    /// The board; both if it is left out.
    #[arg(value_enum)]
    board: Option<Board>,
    /// Leave it running at a TCP port for a bridge, until Ctrl-C, in place of the tests.
    #[arg(long, requires = "board")]
    live: bool,
    /// TCP port of 127.0.0.1 for --live.
    #[arg(long, default_value_t = 5556, requires = "live")]
    port: u16,
    /// Run the image with the other port, for --live: the UART of the NUCLEO-H743ZI2, USB of the NUCLEO-F446RE.
    #[arg(long, requires = "live")]
    other_port: bool,
    /// Print one JSON object in place of a table.
    #[arg(long, conflicts_with = "live")]
    json: bool,
}

impl BoardOptions {
    /// Both boards, as a table.
    pub(crate) const TESTS: Self = Self {
        board: None,
        live: false,
        port: 0,
        other_port: false,
        json: false,
    };
}

/// A board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// NUCLEO-H743ZI2.
    H743,
    /// NUCLEO-F446RE.
    F446,
}

impl Board {
    const ALL: [Self; 2] = [Self::H743, Self::F446];

    /// Its word: in the names of its tests, images and package.
    const fn key(self) -> &'static str {
        match self {
            Self::H743 => "h743",
            Self::F446 => "f446",
        }
    }
}

/// Builds the images, and runs the tests of the emulated boards with them or leaves one running.
///
/// # Errors
/// A toolchain is missing, an image does not build, a test fails, or the port is occupied.
pub(crate) fn board(options: &BoardOptions) -> Result<(), Failure> {
    ensure_toolchain()?;
    let boards = options
        .board
        .map_or(Board::ALL.to_vec(), |board| vec![board]);
    let images = Images::build(&boards)?;
    if let (true, [board]) = (options.live, &boards[..]) {
        return live(*board, &images, options);
    }
    let bridge = images::bridge()?;
    let figures = images.folder().join("figures.jsonl");
    // A run without figures must not show those of the one before.
    let _ = std::fs::remove_file(&figures);
    let mut test = emulated(&["test", "--release", "--test", "boards", "--"]);
    test.args(boards.iter().map(|board| board.key()));
    test.env("CORTICODE_BRIDGE", bridge)
        .env("CORTICODE_FIGURES", &figures);
    for (variable, image) in images.variables() {
        test.env(variable, image);
    }
    if options.json {
        // The object stands alone on the standard output.
        test.stdout(std::io::stderr());
    }
    let passed = run(
        &mut test,
        "run the failed test alone, as docs/bring-up.md has it under \"Reproduce a fault on a virtual board\"",
    );
    report::print(&boards, &figures, passed.is_ok(), options.json)?;
    passed
}

/// Lints the emulated boards and runs their own tests: models of what the emulator lacks, and bad input.
///
/// # Errors
/// The toolchain is missing, a lint fires, or a test fails.
pub(crate) fn models() -> Result<(), Failure> {
    ensure_toolchain()?;
    run(
        &mut emulated(&[
            "clippy",
            "--release",
            "--all-targets",
            "--",
            "-D",
            "warnings",
        ]),
        "mend what clippy names above",
    )?;
    run(
        &mut emulated(&[
            "test",
            "--release",
            "--lib",
            "--bins",
            "--test",
            "command_line",
        ]),
        "a model of the emulated board is wrong, or a message: run the failed test alone",
    )
}

/// Makes sure that the toolchain is there; rustup's own way of installing on demand is off on many machines.
fn ensure_toolchain() -> Result<(), Failure> {
    let mut version = Command::new("rustup");
    if succeeds(version.args(["run", &TOOLCHAIN, "cargo", "clippy", "--version"])) {
        return Ok(());
    }
    let mut install = Command::new("rustup");
    install.args(["toolchain", "install", &TOOLCHAIN, "--profile", "minimal"]);
    install.args(["--component", "clippy"]);
    let line = typed(&install);
    run(&mut install, "").map_err(|failure| Failure::Missing {
        what: format!(
            "Rust {}, which the emulated boards are built with",
            *TOOLCHAIN
        ),
        why: failure.to_string(),
        next: format!("`{line}`"),
    })
}

/// A cargo command in the workspace of the emulated boards, with its own toolchain and target folder.
fn emulated(arguments: &[&str]) -> Command {
    let mut command = Command::new("rustup");
    command
        .args(["run", &TOOLCHAIN, "cargo"])
        .args(arguments)
        .current_dir(root().join(PROGRAM));
    if let Ok(target) = crate::benchmark::emulator::target_folder() {
        command.env("CARGO_TARGET_DIR", target.join("virtual-board"));
    }
    command
}

fn live(board: Board, images: &Images, options: &BoardOptions) -> Result<(), Failure> {
    let image: PathBuf = images.of(board, options.other_port);
    let cable = if (board == Board::H743) == options.other_port {
        "uart"
    } else {
        "usb"
    };
    let mut command = emulated(&["run", "--release", "--quiet", "--", board.key()]);
    command.arg("--image").arg(&image);
    command.args(["--port", &options.port.to_string(), "--cable", cable]);
    run(&mut command, "the message above says what to do")
}
