//! Subcommands of `cargo xtask` that run one program and pass on its output and exit status.

use std::path::PathBuf;
use std::process::Command;

use clap::ValueEnum;

use crate::command::{
    AFTER_A_BUILD, BOARD_TARGET, Failure, OrFail, cargo, replace, run, succeeds, target_folder,
    typed,
};
use crate::images::{self, Board, Rig};
use crate::install;

/// Arguments of cargo that build host-sim and the bridge for the commands below. ROS 2 is left out,
/// because its 53 crates would take a quarter of the build time.
const BUILD: &str = "build --profile quick --bins --no-default-features --features host-sim/program \
    --package host-sim --package bridge";

/// Builds the demo, host-sim and the bridge with one call of cargo, then runs the demo.
pub(crate) fn demo(seconds: u32, seed: u64) -> Result<(), Failure> {
    eprintln!(
        "The whole path of Corticode for {seconds} s: synthetic EEG, virtual board, bridge, ROS master and \
         subscriber, then four pictures in target/demo/.\n\
         First its programs are built, which takes a minute and a half the first time."
    );
    let build = format!("{BUILD} --package demo");
    run(&mut cargo(&build), AFTER_A_BUILD)?;
    let mut demo = Command::new(target_folder().join("quick/demo"));
    replace(demo.args([seconds.to_string(), seed.to_string()]))
}

/// Builds host-sim and the bridge, then shows synthetic EEG on a live page until Ctrl-C.
pub(crate) fn live_demo(seed: u64) -> Result<(), Failure> {
    eprintln!(
        "Synthetic EEG, virtual board, bridge and live page, without ROS, until Ctrl-C.\n\
         First its programs are built, which takes a minute and a half the first time."
    );
    run(&mut cargo(BUILD), AFTER_A_BUILD)?;
    let programs = target_folder().join("quick");
    let folder = target_folder().join("live");
    std::fs::create_dir_all(&folder).or_fail("the folder of the port", "make room on the disk")?;
    let port = folder.join("board");
    let mut board = Command::new(programs.join("host-sim"));
    board.args(["run", "-q", "--input=synthetic", "--realtime"]);
    board.arg(format!("--seed={seed}"));
    board.arg(format!("--output=pty:{}", port.display()));
    let next = "end another `cargo demo --live`";
    let mut running = board.spawn().or_fail(typed(&board), next)?;
    let mut bridge = Command::new(programs.join("corticode-bridge"));
    bridge.arg("--port").arg(port).args([
        "--sink=view",
        "--streams=codes,packed,raw,filtered,events",
        "--open-browser",
    ]);
    let shown = run(&mut bridge, "choose another --view-address: CORTICODE_VIEW_ADDRESS");
    // An error means that Ctrl-C has already ended host-sim.
    let _ = running.kill();
    let _ = running.wait();
    shown
}

/// Builds the demo, host-sim, the bridge and the trainer with one call of cargo, then runs the
/// closed loop: on the recording and with the classifier in `own`, or on synthetic EEG.
pub(crate) fn closed_loop(
    mains_and_seed: [&str; 2],
    fast: bool,
    own: &[PathBuf],
) -> Result<(), Failure> {
    eprintln!(
        "A closed loop: a recording with cues, virtual board, bridge, classifier, and a picture, target/loop/loop.svg.\n\
         First its programs are built, which takes about two minutes the first time."
    );
    let build = format!("{BUILD} --package demo --package trainer");
    run(&mut cargo(&build), AFTER_A_BUILD)?;
    let mut demo = Command::new(target_folder().join("quick/demo"));
    let pace = if fast { "fast" } else { "realtime" };
    replace(demo.arg("loop").args(mains_and_seed).arg(pace).args(own))
}

/// Runs the benchmark program `report` with the arguments `words`. Compiles it with optimisation
/// only for `offline`, `bridge` and `node`, which measure times on this PC.
pub(crate) fn bench(words: &[String]) -> Result<(), Failure> {
    install::board_target()?;
    match words.first().map(String::as_str) {
        Some("offline") => {
            replace(cargo("run --release --package bench --bin report --").args(words))
        }
        Some(benchmark @ ("bridge" | "node")) => {
            let board = if benchmark == "bridge" { " --package host-sim" } else { "" };
            let build =
                format!("build --release --package bench --package {benchmark}{board} --bins");
            run(&mut cargo(&build), AFTER_A_BUILD)?;
            replace(Command::new(target_folder().join("release/report")).args(words))
        }
        _ => replace(cargo("run --package bench --bin report --").args(words)),
    }
}

/// Board for which the golden vectors are linked.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Nucleo {
    /// NUCLEO-H743ZI2.
    H743,
    /// NUCLEO-F446RE.
    F446,
}

impl Nucleo {
    const fn key(self) -> &'static str {
        match self {
            Self::H743 => Board::H743.key(),
            Self::F446 => Board::F446.key(),
        }
    }
}

/// Runs the golden vectors on `board`, or on both emulated microcontrollers if `None`.
pub(crate) fn hil(board: Option<Nucleo>) -> Result<(), Failure> {
    install::board_target()?;
    let Some(board) = board else {
        let test = "test --package emulated golden_vectors:: -- --nocapture";
        return replace(&mut cargo(test));
    };
    require_probe_rs()?;
    link_vectors(board)?;
    let image = target_folder().join(BOARD_TARGET).join("firmware/on-target");
    let run = format!("run --quiet --package on-target -- {}", board.key());
    replace(cargo(&run).arg(image))
}

/// Builds the image with the golden vectors for a board, which also shows that the image fits the
/// board's memory.
pub(crate) fn link_vectors(board: Nucleo) -> Result<(), Failure> {
    let build = "build --package=on-target --bin=on-target --profile=firmware";
    let words = format!("{build} --target={BOARD_TARGET} --features={}", board.key());
    run(&mut cargo(&words), AFTER_A_BUILD)
}

/// Builds the images of the boards and checks their sizes and layouts.
pub(crate) fn budget(json: bool) -> Result<(), Failure> {
    Rig::ALL.into_iter().try_for_each(images::build)?;
    let mut budget = cargo("run --quiet --package budget --");
    replace(budget.arg(images::folder()).args(json.then_some("--json")))
}

/// Runs the application in real time on an emulated microcontroller, with its link on TCP port
/// `port`.
pub(crate) fn live_qemu(port: u16) -> Result<(), Failure> {
    install::board_target()?;
    let live = format!("run --package emulated --bin live -- --port {port}");
    replace(&mut cargo(&live))
}

/// Runs cargo-deny in this workspace and in the emulated boards' workspace.
pub(crate) fn deny() -> Result<(), Failure> {
    let install = "`cargo install --locked cargo-deny`";
    require("cargo-deny", &mut cargo("deny"), install)?;
    let next = "read its report above, then the deny.toml next to that manifest";
    ["Cargo.toml", "tests/virtual-board/Cargo.toml"]
        .map(|manifest| format!("deny --manifest-path {manifest} check"))
        .iter()
        .try_for_each(|check| run(&mut cargo(check), next))
}

/// Returns an error with the command that installs probe-rs, unless probe-rs runs.
pub(crate) fn require_probe_rs() -> Result<(), Failure> {
    let install = "`cargo install probe-rs-tools --version 0.32.0 --locked`";
    require("probe-rs", &mut Command::new("probe-rs"), install)
}

fn require(name: &str, program: &mut Command, install: &str) -> Result<(), Failure> {
    if succeeds(program.arg("--version")) {
        return Ok(());
    }
    let why = format!("{} does not run", typed(program));
    Err(Failure::missing(name, why, install))
}
