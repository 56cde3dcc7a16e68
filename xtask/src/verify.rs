//! `cargo xtask test`: everything that CI checks, in the order in which it fails fastest.

use std::process::Command;
use std::time::{Duration, Instant};

use crate::benchmark::{self, BenchOptions};
use crate::board::{self, BoardOptions};
use crate::budget::{self, BudgetOptions};
use crate::command::{cargo_with, root, run, succeeds};
use crate::debian;
use crate::failure::Failure;
use crate::hil::{self, HilOptions};
use crate::qemu::{self, QemuOptions};

/// The microcontroller's target: Cortex-M4F and M7 with single-precision FPU.
pub(crate) const BOARD_TARGET: &str = "thumbv7em-none-eabihf";

/// Crates that run on the microcontroller.
const BOARD_CRATES: [&str; 6] = [
    "ads1299",
    "fixed-dsp",
    "int8-nn",
    "model",
    "pipeline",
    "link",
];

/// What a person does about a failed test.
const NEXT_AFTER_A_TEST: &str =
    "run the failed test alone: `cargo test --package CRATE TEST_NAME`, its name as printed above";

/// What a person does about a lint.
const NEXT_AFTER_A_LINT: &str =
    "mend what clippy names above; a lint that is wrong gets `#[expect(.., reason = \"..\")]`";

/// A step: its name, and what does it.
type Step = (&'static str, fn() -> Result<(), Failure>);

/// Runs every step and stops at the first that fails. `fast` leaves out the trainer and
/// the benchmarks, and installs nothing.
///
/// # Errors
/// The failure of the first step that did not pass.
pub(crate) fn verify(fast: bool) -> Result<(), Failure> {
    let mut steps: Vec<Step> = vec![
        ("the microcontroller's target", board_target),
        ("format", format),
    ];
    let mut skipped = Vec::new();
    if deny_is_installed() {
        steps.push(("licences, advisories, sources", deny));
    } else {
        skipped.push("advisories and sources: `cargo install --locked cargo-deny`");
    }
    if std::env::var_os("CORTICODE_DATA").is_none() {
        skipped.push("what needs real recordings: set CORTICODE_DATA to their folder");
    }
    if fast {
        skipped.push("the trainer and the benchmarks, and what needs ROS where it is missing: leave --fast out");
        steps.push(("lints, without the trainer", lints_without_trainer));
        steps.push(("no_std crates for the microcontroller", board_build));
        steps.push(("tests", tests));
    } else {
        steps.insert(0, ("Debian's packages", debian::ensure));
        steps.push(("lints", lints));
        steps.push(("no_std crates for the microcontroller", board_build));
        steps.push((
            "filters on the emulated microcontroller",
            filters_on_emulator,
        ));
        steps.push((
            "encoder on the emulated microcontroller",
            encoder_on_emulator,
        ));
        steps.push((
            "golden vectors on the emulated microcontroller",
            vectors_on_emulator,
        ));
        steps.push((
            "application on the emulated microcontroller",
            application_on_emulator,
        ));
        steps.push(("boards", boards));
        steps.push(("boards, emulated", boards_on_emulator));
        steps.push(("trainer", trainer_tests));
        steps.push(("tests, and acceptance with ROS", tests_with_ros));
    }
    say_skipped(&skipped);

    let begin = Instant::now();
    let total = steps.len();
    for (index, (name, step)) in steps.into_iter().enumerate() {
        eprintln!("\n[{}/{total}] {name}", index + 1);
        let step_begin = Instant::now();
        step()?;
        eprintln!(
            "[{}/{total}] {name}: passed in {}",
            index + 1,
            spoken(step_begin.elapsed())
        );
    }
    eprintln!(
        "\nxtask test: all {total} steps passed in {}",
        spoken(begin.elapsed())
    );
    say_skipped(&skipped);
    Ok(())
}

fn say_skipped(skipped: &[&str]) {
    for what in skipped {
        eprintln!("SKIPPED: {what}");
    }
}

fn deny_is_installed() -> bool {
    succeeds(&mut cargo_with(&["deny", "--version"]))
}

/// cargo-deny over deny.toml.
///
/// # Errors
/// cargo-deny is missing, or refused something.
pub(crate) fn deny() -> Result<(), Failure> {
    if !deny_is_installed() {
        return Err(Failure::Missing {
            what: "cargo-deny".to_owned(),
            why: "`cargo deny --version` does not run".to_owned(),
            next: "`cargo install --locked cargo-deny`".to_owned(),
        });
    }
    // The emulated boards are a workspace of their own.
    for manifest in ["Cargo.toml", "tests/virtual-board/Cargo.toml"] {
        run(
            &mut cargo_with(&["deny", "--manifest-path", manifest, "check"]),
            "read its report above, then the deny.toml next to that manifest",
        )?;
    }
    Ok(())
}

/// Makes sure that the target's standard library is there.
///
/// # Errors
/// It is not, and rustup cannot add it.
pub(crate) fn board_target() -> Result<(), Failure> {
    let list = Command::new("rustup")
        .args(["target", "list", "--installed"])
        .output();
    if list.is_ok_and(|list| String::from_utf8_lossy(&list.stdout).contains(BOARD_TARGET)) {
        return Ok(());
    }
    // Without rustup the target may still be there, from a distribution's own toolchain.
    let add = run(
        Command::new("rustup").args(["target", "add", BOARD_TARGET]),
        "",
    );
    add.map_err(|failure| Failure::Missing {
        what: format!("the standard library for {BOARD_TARGET}"),
        why: failure.to_string(),
        next: format!("`rustup target add {BOARD_TARGET}`"),
    })
}

fn format() -> Result<(), Failure> {
    run(
        &mut cargo_with(&["fmt", "--all", "--check"]),
        "`cargo fmt --all`",
    )
}

fn lints() -> Result<(), Failure> {
    clippy(&[])
}

fn lints_without_trainer() -> Result<(), Failure> {
    clippy(&["--exclude", "trainer"])
}

fn clippy(exclude: &[&str]) -> Result<(), Failure> {
    let mut command = cargo_with(&["clippy", "--workspace", "--all-targets"]);
    run(
        command.args(exclude).args(["--", "-D", "warnings"]),
        NEXT_AFTER_A_LINT,
    )
}

fn board_build() -> Result<(), Failure> {
    let mut build = cargo_with(&["build", "--release", "--target", BOARD_TARGET]);
    for name in BOARD_CRATES {
        build.args(["--package", name]);
    }
    run(
        &mut build,
        "a std-only item or feature got into one of these crates",
    )
}

fn filters_on_emulator() -> Result<(), Failure> {
    // Clippy over the workspace sees the PC's side of these crates only.
    for machine in benchmark::emulator::MACHINES {
        let mut lints = cargo_with(&["clippy", "--target", BOARD_TARGET, "--package=bench"]);
        lints.args([
            "--package=fixed-dsp",
            "--package=int8-nn",
            "--package=pipeline",
        ]);
        lints.args(machine.features).args(["--", "-D", "warnings"]);
        run(&mut lints, NEXT_AFTER_A_LINT)?;
    }
    // No default member, so that `cargo test` does not see it.
    run(
        &mut cargo_with(&["test", "--package", "bench"]),
        NEXT_AFTER_A_TEST,
    )?;
    benchmark::bench(BenchOptions::FILTERS)
}

fn encoder_on_emulator() -> Result<(), Failure> {
    benchmark::bench(BenchOptions::ENCODER)
}

fn vectors_on_emulator() -> Result<(), Failure> {
    for machine in benchmark::emulator::MACHINES {
        let mut lints = cargo_with(&["clippy", "--target", BOARD_TARGET, "--package=on-target"]);
        lints.args(machine.features).args(["--", "-D", "warnings"]);
        run(&mut lints, NEXT_AFTER_A_LINT)?;
    }
    // No default member, so that `cargo test` does not see it.
    run(
        &mut cargo_with(&["test", "--package", "on-target"]),
        NEXT_AFTER_A_TEST,
    )?;
    hil::link_for_boards()?;
    hil::hil(HilOptions::EMULATED)
}

fn application_on_emulator() -> Result<(), Failure> {
    for machine in benchmark::emulator::MACHINES {
        let mut lints = cargo_with(&["clippy", "--target", BOARD_TARGET, "--package=device"]);
        lints.args(["--package=firmware", "--package=board-qemu"]);
        lints.args(machine.features).args(["--", "-D", "warnings"]);
        run(&mut lints, NEXT_AFTER_A_LINT)?;
    }
    qemu::qemu(QemuOptions::VIRTUAL)
}

fn boards() -> Result<(), Failure> {
    // No default members; their pins are those of the documentation.
    let mut tests = cargo_with(&["test"]);
    for package in budget::packages() {
        tests.args(["--package", package]);
    }
    run(tests.args(["--package", "board-stm32"]), NEXT_AFTER_A_TEST)?;
    for package in budget::packages() {
        for port in budget::PORTS {
            let mut lints = cargo_with(&["clippy", "--target", BOARD_TARGET]);
            lints.args(["--package", package, "--package", "board-stm32"]);
            lints.args(port).args(["--", "-D", "warnings"]);
            run(&mut lints, NEXT_AFTER_A_LINT)?;
        }
    }
    budget::budget(BudgetOptions::TABLE)
}

fn boards_on_emulator() -> Result<(), Failure> {
    let manifest = root().join("tests/virtual-board/Cargo.toml");
    let manifest = format!("--manifest-path={}", manifest.display());
    run(
        &mut cargo_with(&["fmt", &manifest, "--check"]),
        "`cargo fmt --manifest-path tests/virtual-board/Cargo.toml`",
    )?;
    board::models()?;
    board::board(&BoardOptions::TESTS)
}

fn trainer_tests() -> Result<(), Failure> {
    run(
        &mut cargo_with(&["test", "--package", "trainer"]),
        "run the failed test alone: `cargo test --package trainer TEST_NAME`",
    )
}

fn tests() -> Result<(), Failure> {
    run(&mut cargo_with(&["test"]), NEXT_AFTER_A_TEST)
}

fn tests_with_ros() -> Result<(), Failure> {
    run(
        cargo_with(&["test"]).env("CORTICODE_REQUIRE_ROS", "1"),
        NEXT_AFTER_A_TEST,
    )
}

/// A duration as a person says it: "850 ms", "12.3 s", "3 min 20 s".
fn spoken(time: Duration) -> String {
    let seconds = time.as_secs();
    if seconds == 0 {
        format!("{} ms", time.as_millis())
    } else if seconds < 60 {
        format!("{:.1} s", time.as_secs_f64())
    } else {
        format!("{} min {} s", seconds / 60, seconds % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_spoken_in_the_unit_a_person_would_use() {
        assert_eq!(spoken(Duration::from_millis(850)), "850 ms");
        assert_eq!(spoken(Duration::from_millis(12_340)), "12.3 s");
        assert_eq!(spoken(Duration::from_secs(200)), "3 min 20 s");
    }
}
