//! `cargo xtask test`: everything that CI checks, in stages that start with the quick checks.

use std::process::Command;
use std::time::Instant;

use crate::command::{
    AFTER_A_BUILD, AFTER_A_TEST, BOARD_TARGET, Failure, cargo, run, target_folder,
};
use crate::images::{self, Board};
use crate::{board, docs, figures, install, programs, qemu};

const AFTER_A_LINT: &str =
    "mend what clippy names above; a lint that is wrong gets `#[expect(.., reason = \"..\")]`";

/// Cargo arguments for the lints: the crates that run on a microcontroller without a feature for one board,
/// and the images for emulated microcontrollers.
const THUMB_CRATES: &str = "--package=ads1299 --package=fixed-dsp --package=int8-nn --package=packed --package=model \
    --package=pipeline --package=link --package=device --package=firmware --package=bench \
    --package=on-target --package=board-qemu";
/// An image for models that are smaller than the default one, which does not fit.
const F446_WITH_BOTH_ENCODERS: &str =
    "--package=board-f446 --no-default-features --features=uart,network,packed";

/// Name of a stage, and the function that runs it.
type Stage = (&'static str, fn() -> Result<(), Failure>);

/// Stages of `test --fast`, in the order in which they run.
#[rustfmt::skip]
const FAST: &[Stage] = &[
    ("format", format),
    ("the microcontrollers' target", install::board_target),
    ("lints", || lints("--all-targets --workspace")),
    ("lints for the microcontrollers", lints_for_microcontrollers),
    ("tests", fast_tests),
];

/// Stages of `test`, in the order in which they run.
#[rustfmt::skip]
const FULL: &[Stage] = &[
    ("format", format),
    ("Debian packages, Rust's targets and toolchains", install::install),
    ("lints", || lints("--all-targets --workspace")),
    ("lints for the microcontrollers", lints_for_microcontrollers),
    ("lints for the boards", lints_for_boards),
    ("tests, with ROS and emulated microcontrollers", full_tests),
    ("benchmarks on emulated microcontrollers", benchmarks),
    ("images for the boards", images_for_boards),
    ("virtual boards: models", board::models),
    ("virtual boards: images that are flashed", || board::test(&Board::ALL, false)),
    ("figures of docs/figures.md", docs::check),
];

/// Runs the stages and stops at the first that fails.
pub(crate) fn test(fast: bool) -> Result<(), Failure> {
    let stages = if fast { FAST } else { FULL };
    let total = stages.len();
    print_skipped(fast);
    let start = Instant::now();
    for (number, (name, stage)) in (1..).zip(stages) {
        eprintln!("\n[{number}/{total}] {name}");
        let stage_start = Instant::now();
        stage()?;
        let time = time_since(stage_start);
        eprintln!("[{number}/{total}] {name}: passed in {time}");
    }
    let time = time_since(start);
    eprintln!("\nxtask test: all {total} stages passed in {time}");
    print_skipped(fast);
    Ok(())
}

fn print_skipped(fast: bool) {
    if fast {
        eprintln!(
            "SKIPPED: the emulators, the benchmarks and models of other shapes, and what needs \
             ROS where it is missing: leave --fast out"
        );
    }
    if std::env::var_os("CORTICODE_DATA").is_none() {
        eprintln!("SKIPPED: what needs real recordings: set CORTICODE_DATA to their folder");
    }
}

fn format() -> Result<(), Failure> {
    for manifest in ["Cargo.toml", "tests/virtual-board/Cargo.toml"] {
        let words = format!("fmt --all --manifest-path={manifest}");
        let mut check = cargo(&words);
        run(check.arg("--check"), &format!("`cargo {words}`"))?;
    }
    Ok(())
}

fn lints(options: &str) -> Result<(), Failure> {
    let words = format!("clippy {options} -- -D warnings");
    run(&mut cargo(&words), AFTER_A_LINT)
}

/// Lints the selected packages for the microcontrollers' target, which includes code that is not compiled for
/// a PC. Uses the profile of the images, so that lints and images share compiled macros and build scripts.
fn lints_for_target(selection: &str) -> Result<(), Failure> {
    let target = format!("--profile=firmware --target={BOARD_TARGET}");
    lints(&format!("{target} {selection}"))
}

fn lints_for_microcontrollers() -> Result<(), Failure> {
    lints_for_target(THUMB_CRATES)?;
    lints_for_target(&format!("{THUMB_CRATES} --features=pipeline/cortex-m7"))
}

/// Lints every board with each of its ports in a separate call of cargo, because the features of the two
/// chips exclude each other.
fn lints_for_boards() -> Result<(), Failure> {
    let images = Board::ALL.into_iter().flat_map(Board::images);
    let mut images = images.map(|[_, selection]| *selection);
    let lint = |image: &str| lints_for_target(&format!("--package=board-stm32 {image}"));
    images.try_for_each(lint)?;
    lint(F446_WITH_BOTH_ENCODERS)
}

/// Tests the default members of the workspace, except for models of other shapes.
fn fast_tests() -> Result<(), Failure> {
    let skip = "--skip any_model_streams_as_it_batches";
    tests("", &mut cargo(&format!("test -- {skip}")))
}

/// Tests all members of the workspace, and prints the figures of the emulated microcontrollers.
fn full_tests() -> Result<(), Failure> {
    let mut test = cargo("test --workspace");
    let figures = figures::attach(&mut test, "qemu", false);
    tests("--workspace", test.env("CORTICODE_REQUIRE_ROS", "1"))?;
    qemu::report(&figures, None, false)
}

/// Builds the programs that tests start, then runs the tests with these builds. Both commands must select the
/// same packages: otherwise cargo would compile most crates twice, with different features.
fn tests(selection: &str, test: &mut Command) -> Result<(), Failure> {
    let build = format!("build --bins --tests {selection}");
    run(&mut cargo(&build), AFTER_A_BUILD)?;
    let programs = target_folder().join("debug");
    run(test.env("CORTICODE_PROGRAMS", programs), AFTER_A_TEST)
}

fn benchmarks() -> Result<(), Failure> {
    let next = "compare with `git log` of the crates that it names";
    for benchmark in ["filters", "encoder", "packed", "lossless"] {
        let mut report = Command::new(target_folder().join("debug/report"));
        docs::attach(&mut report, &format!("bench {benchmark}"))?;
        run(report.arg(benchmark), next)?;
    }
    Ok(())
}

fn images_for_boards() -> Result<(), Failure> {
    for board in Board::ALL {
        programs::link_vectors(board)?;
        images::build(board)?;
    }
    let mut budget = Command::new(target_folder().join("debug/budget"));
    docs::attach(&mut budget, "budget")?;
    run(budget.arg(images::folder()), "see the message above")
}

fn time_since(start: Instant) -> String {
    let seconds = start.elapsed().as_secs();
    format!("{} min {} s", seconds / 60, seconds % 60)
}
