//! `cargo xtask test`: everything that CI checks, with the checks that fail fastest first.

use std::process::Command;
use std::time::{Duration, Instant};

use crate::command::{AFTER_A_BUILD, BOARD_TARGET, Failure, cargo, run, succeeds, target_folder};
use crate::images::{self, Board};
use crate::{board, docs, figures, install, programs, qemu};

const AFTER_A_LINT: &str =
    "mend what clippy names above; a lint that is wrong gets `#[expect(.., reason = \"..\")]`";
const AFTER_A_TEST: &str =
    "run the failed test alone: `cargo test --package CRATE TEST_NAME`, its name as printed above";

/// Environment variable: the folder of the built programs. Tests with it do not build them again.
const PROGRAMS: &str = "CORTICODE_PROGRAMS";

/// Environment variable: the file to which a program writes the JSON object that `--json` prints.
const OBJECT: &str = "CORTICODE_OBJECT";

/// Crates that run on a microcontroller and need no feature of a board, and the images for emulated
/// microcontrollers.
const THUMB_CRATES: &str = "--package=ads1299 --package=fixed-dsp --package=int8-nn --package=model \
    --package=pipeline --package=link --package=device --package=firmware --package=bench \
    --package=on-target --package=board-qemu";

/// Whether a stage runs always, only with `--fast`, or only without it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum When {
    Always,
    Fast,
    Full,
}

/// Name of a stage, when it runs, and what it does.
type Stage = (&'static str, When, fn() -> Result<(), Failure>);

/// Every stage, in the order in which they run.
#[rustfmt::skip]
const STAGES: [Stage; 15] = [
    ("format", When::Always, format),
    ("the microcontrollers' target", When::Fast, install::board_target),
    ("Debian packages, Rust's targets and toolchains", When::Full, install::install),
    ("lints, without the trainer", When::Fast, || lints("--workspace --exclude=trainer")),
    ("lints", When::Full, || lints("--workspace")),
    ("lints for the microcontrollers", When::Always, lints_for_microcontrollers),
    ("lints for the boards", When::Full, lints_for_boards),
    ("tests", When::Fast, fast_tests),
    ("tests, with ROS and emulated microcontrollers", When::Full, full_tests),
    ("benchmarks on emulated microcontrollers", When::Full, benchmarks),
    ("images for the boards", When::Full, images_for_boards),
    ("virtual boards: models", When::Full, board::models),
    ("virtual boards: images that are flashed", When::Full, || board::test(&Board::ALL, false)),
    ("figures of docs/figures.md", When::Full, docs::check),
    ("cargo-deny, where it is installed", When::Always, deny_where_installed),
];

/// Runs the stages and stops at the first that fails.
///
/// # Errors
/// The failure of the first stage that fails.
pub(crate) fn test(fast: bool) -> Result<(), Failure> {
    let left_out = if fast { When::Full } else { When::Fast };
    let stages = STAGES.into_iter().filter(|(_, when, _)| *when != left_out);
    let stages: Vec<Stage> = stages.collect();
    print_skipped(fast);
    let start = Instant::now();
    let total = stages.len();
    for (number, (name, _, stage)) in (1..).zip(stages) {
        eprintln!("\n[{number}/{total}] {name}");
        let stage_start = Instant::now();
        stage()?;
        let time = readable(stage_start.elapsed());
        eprintln!("[{number}/{total}] {name}: passed in {time}");
    }
    eprintln!(
        "\nxtask test: all {total} stages passed in {}",
        readable(start.elapsed())
    );
    print_skipped(fast);
    Ok(())
}

fn print_skipped(fast: bool) {
    if fast {
        eprintln!(
            "SKIPPED: the trainer, the emulators, the benchmarks and models of other shapes, and what needs \
             ROS where it is missing: leave --fast out"
        );
    }
    if std::env::var_os("CORTICODE_DATA").is_none() {
        eprintln!("SKIPPED: what needs real recordings: set CORTICODE_DATA to their folder");
    }
}

fn format() -> Result<(), Failure> {
    ["Cargo.toml", "tests/virtual-board/Cargo.toml"]
        .map(|manifest| format!("fmt --all --manifest-path={manifest}"))
        .iter()
        .try_for_each(|words| {
            run(
                &mut cargo(&format!("{words} --check")),
                &format!("`cargo {words}`"),
            )
        })
}

fn lints(selection: &str) -> Result<(), Failure> {
    let words = format!("clippy --all-targets {selection} -- -D warnings");
    run(&mut cargo(&words), AFTER_A_LINT)
}

/// Lints code that only the microcontrollers' compiler sees. The profile is that of the images, so lints and
/// images share compiled macros and build scripts.
fn lints_for_target(selection: &str) -> Result<(), Failure> {
    let clippy = format!("clippy --profile=firmware --target={BOARD_TARGET}");
    run(
        &mut cargo(&format!("{clippy} {selection} -- -D warnings")),
        AFTER_A_LINT,
    )
}

fn lints_for_microcontrollers() -> Result<(), Failure> {
    lints_for_target(THUMB_CRATES)?;
    lints_for_target(&format!("{THUMB_CRATES} --features=pipeline/cortex-m7"))
}

/// Lints each board with each of its ports, one after the other, because the chips' features exclude each
/// other.
fn lints_for_boards() -> Result<(), Failure> {
    let images = Board::ALL.into_iter().flat_map(Board::images);
    images
        .map(|[_, image]| format!("--package=board-stm32 {image}"))
        .try_for_each(|selection| lints_for_target(&selection))
}

/// Tests the default members of the workspace.
fn fast_tests() -> Result<(), Failure> {
    let skip = "--skip any_model_streams_as_it_batches --skip yanked";
    tests("", &mut cargo(&format!("test -- {skip}")))
}

/// Tests all members of the workspace, and prints the figures of the emulated microcontrollers.
fn full_tests() -> Result<(), Failure> {
    let figures = figures::File::new("qemu");
    let mut test = cargo("test --workspace");
    test.env("CORTICODE_REQUIRE_ROS", "1");
    tests("--workspace", figures.attach(&mut test, false))?;
    qemu::print(&figures, false, None)
}

/// Builds the programs that tests start, and runs the tests. Both commands select the same packages: with
/// different selections, most crates would have different features and be compiled twice.
fn tests(selection: &str, test: &mut Command) -> Result<(), Failure> {
    run(
        &mut cargo(&format!("build --bins --tests {selection}")),
        AFTER_A_BUILD,
    )?;
    run(
        test.env(PROGRAMS, target_folder().join("debug")),
        AFTER_A_TEST,
    )
}

fn benchmarks() -> Result<(), Failure> {
    let next = "compare with `git log` of the crates that it names";
    ["filters", "encoder"]
        .into_iter()
        .try_for_each(|benchmark| {
            let mut report = Command::new(target_folder().join("debug/report"));
            let object = docs::object_file(&format!("bench {benchmark}"));
            run(report.arg(benchmark).env(OBJECT, object), next)
        })
}

fn images_for_boards() -> Result<(), Failure> {
    Board::ALL
        .into_iter()
        .try_for_each(programs::link_vectors)?;
    Board::ALL.into_iter().try_for_each(images::build)?;
    let mut budget = Command::new(target_folder().join("debug/budget"));
    budget.arg(images::folder());
    run(
        budget.env(OBJECT, docs::object_file("budget")),
        "see the message above",
    )
}

/// Only the advisories in deny.toml need cargo-deny; tests/tests/licences.rs and sources.rs check the rest of
/// it.
fn deny_where_installed() -> Result<(), Failure> {
    if succeeds(&mut cargo("deny --version")) {
        return programs::deny();
    }
    Ok(())
}

/// Formats a duration in the unit that suits its size: "850 ms", "12.3 s", "3 min 20 s".
fn readable(time: Duration) -> String {
    match time.as_secs() {
        0 => format!("{} ms", time.as_millis()),
        1..60 => format!("{:.1} s", time.as_secs_f64()),
        seconds => format!("{} min {} s", seconds / 60, seconds % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_printed_in_the_unit_a_reader_would_use() {
        assert_eq!(readable(Duration::from_millis(850)), "850 ms");
        assert_eq!(readable(Duration::from_millis(12_340)), "12.3 s");
        assert_eq!(readable(Duration::from_secs(200)), "3 min 20 s");
    }
}
