//! `cargo xtask test`: everything that CI checks, in the order in which it fails fastest.

use std::process::Command;
use std::time::{Duration, Instant};

use crate::command::{
    AFTER_A_BUILD, BOARD_TARGET, Failure, VIRTUAL_BOARD, cargo, run, succeeds, target_folder,
};
use crate::images::{self, Board};
use crate::{board, figures, hil, install, programs, qemu};

const AFTER_A_LINT: &str =
    "mend what clippy names above; a lint that is wrong gets `#[expect(.., reason = \"..\")]`";
const AFTER_A_TEST: &str =
    "run the failed test alone: `cargo test --package CRATE TEST_NAME`, its name as printed above";

/// Environment variable with the folder of the built programs, so that tests do not build them again.
const PROGRAMS: &str = "CORTICODE_PROGRAMS";

/// Crates that run on a microcontroller without a board's features, and the images for emulated ones.
const THUMB_CRATES: &str = "--package=ads1299 --package=fixed-dsp --package=int8-nn --package=model \
    --package=pipeline --package=link --package=device --package=firmware --package=bench \
    --package=on-target --package=board-qemu";

/// Part of the test in which a stage runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Always,
    /// Only with `--fast`.
    Fast,
    /// Only without `--fast`.
    Full,
}

/// One stage: its name, when it runs, and its commands.
type Stage = (&'static str, Part, fn() -> Result<(), Failure>);

/// Every stage in its order.
const STAGES: [Stage; 14] = [
    ("format", Part::Always, format),
    (
        "the microcontrollers' target",
        Part::Fast,
        install::board_target,
    ),
    (
        "Debian packages, Rust's targets and toolchains",
        Part::Full,
        install::install,
    ),
    ("lints, without the trainer", Part::Fast, || {
        lints("--workspace --exclude=trainer")
    }),
    ("lints", Part::Full, || lints("--workspace")),
    (
        "lints for the microcontrollers",
        Part::Always,
        lints_for_microcontrollers,
    ),
    ("lints for the boards", Part::Full, lints_for_boards),
    ("tests", Part::Fast, fast_tests),
    (
        "tests, acceptance with ROS, application on emulated microcontrollers",
        Part::Full,
        tests,
    ),
    (
        "benchmarks on emulated microcontrollers",
        Part::Full,
        benchmarks,
    ),
    ("images for the boards", Part::Full, images_for_boards),
    ("boards, emulated: models", Part::Full, board::models),
    (
        "boards, emulated: images that are flashed",
        Part::Full,
        || board::test(&Board::ALL, false),
    ),
    (
        "cargo-deny, where it is installed",
        Part::Always,
        deny_where_installed,
    ),
];

/// Runs every stage of a part and stops at the first that fails.
///
/// # Errors
/// The failure of the first stage that did not pass.
pub(crate) fn test(fast: bool) -> Result<(), Failure> {
    let left_out = if fast { Part::Full } else { Part::Fast };
    let stages: Vec<_> = STAGES
        .into_iter()
        .filter(|(_, part, _)| *part != left_out)
        .collect();
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
    run(&mut cargo("fmt --all --check"), "`cargo fmt --all`")?;
    let manifest = format!("--manifest-path={VIRTUAL_BOARD}/Cargo.toml");
    let next = format!("`cargo fmt {manifest}`");
    run(&mut cargo(&format!("fmt {manifest} --check")), &next)
}

fn lints(selection: &str) -> Result<(), Failure> {
    let words = format!("clippy --all-targets {selection} -- -D warnings");
    run(&mut cargo(&words), AFTER_A_LINT)
}

/// Lints code that the PC's compiler does not see. With the profile of the images: their build scripts and
/// macros are the same programs.
fn lints_for_microcontrollers() -> Result<(), Failure> {
    for features in ["", "--features=pipeline/cortex-m7"] {
        lints_for_target(&format!("{THUMB_CRATES} {features}"))?;
    }
    Ok(())
}

fn lints_for_boards() -> Result<(), Failure> {
    let images = Board::ALL.into_iter().flat_map(Board::images);
    images
        .map(|[_, selection]| format!("--package=board-stm32 {selection}"))
        .try_for_each(|selection| lints_for_target(&selection))
}

fn lints_for_target(selection: &str) -> Result<(), Failure> {
    let words = format!("clippy --profile=firmware --target={BOARD_TARGET} {selection}");
    run(&mut cargo(&format!("{words} -- -D warnings")), AFTER_A_LINT)
}

/// Tests of the default members, with the programs they start.
fn fast_tests() -> Result<(), Failure> {
    run(&mut cargo("build --bins --tests"), AFTER_A_BUILD)?;
    let mut test = cargo("test -- --skip any_model_streams_as_it_batches");
    run(
        test.env(PROGRAMS, target_folder().join("debug")),
        AFTER_A_TEST,
    )
}

/// Tests of all members, with ROS and the emulated microcontrollers required.
fn tests() -> Result<(), Failure> {
    // One selection of packages for lints, tests and programs: with another one, cargo would compile most
    // crates once more, with other features.
    run(
        &mut cargo("build --workspace --bins --tests"),
        AFTER_A_BUILD,
    )?;
    let figures = figures::File::new("qemu");
    let mut test = cargo("test --workspace");
    test.env(PROGRAMS, target_folder().join("debug"))
        .env("CORTICODE_REQUIRE_ROS", "1");
    run(figures.attach(&mut test, false), AFTER_A_TEST)?;
    qemu::print(&figures, false, None)
}

fn benchmarks() -> Result<(), Failure> {
    for subject in ["filters", "encoder"] {
        let next = "compare with `git log` of the crates that it names";
        run(
            Command::new(target_folder().join("debug/report")).arg(subject),
            next,
        )?;
    }
    Ok(())
}

fn images_for_boards() -> Result<(), Failure> {
    Board::ALL.into_iter().try_for_each(hil::link)?;
    Board::ALL.into_iter().try_for_each(images::build)?;
    let mut budget = Command::new(target_folder().join("debug/budget"));
    run(budget.arg(images::folder()), "see the message above")
}

/// cargo-deny also knows the advisories; tests/tests/licences.rs checks the rest everywhere.
fn deny_where_installed() -> Result<(), Failure> {
    if succeeds(&mut cargo("deny --version")) {
        return programs::deny();
    }
    Ok(())
}

/// Formats a duration in the unit a reader would use: "850 ms", "12.3 s", "3 min 20 s".
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
