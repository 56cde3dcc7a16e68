//! `cargo xtask test`: everything that CI checks, in stages that start with the quick checks.

use std::env;
use std::fs::{self, File};
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use crate::command::{
    AFTER_A_BUILD, AFTER_A_TEST, BOARD_TARGET, Failure, OrFail, cargo, run, target_folder, typed,
};
use crate::images::{self, Rig};
use crate::programs::Nucleo;
use crate::{board, docs, figures, install, programs, qemu};

const AFTER_A_LINT: &str =
    "mend what clippy names above; a lint that is wrong gets `#[expect(.., reason = \"..\")]`";

/// Cargo arguments that select the packages to lint for microcontrollers in addition to the boards:
/// the crates that need no board's feature, and the images for emulated microcontrollers.
const THUMB_CRATES: &str = "--package=ads1299 --package=fixed-dsp --package=int8-nn --package=packed --package=model \
    --package=pipeline --package=link --package=device --package=firmware --package=bench \
    --package=on-target --package=board-qemu";
/// Cargo arguments for the bridge without ROS 2, as `cargo demo` builds it. All other features are
/// the same as in the build of the workspace; `--test recorder` keeps the features that development
/// dependencies select. Cargo therefore compiles hardly any crate again.
const BRIDGE_WITHOUT_ROS2: &str = "build --workspace --lib --test recorder --no-default-features \
    --features host-sim/program,neuro-ros/ros1";
/// Cargo arguments for the NUCLEO-F446RE's image with the network and the packed code. Only models
/// smaller than the default one fit its memory, so this image is linted but not built.
const F446_WITH_BOTH_ENCODERS: &str =
    "--package=board-f446 --no-default-features --features=uart,network,packed";

/// Parts of the names of tests that `--fast` leaves out.
#[rustfmt::skip]
const SLOW_TESTS: &[&str] = &[
    // Tests that start programs or ROS, or build models of other shapes.
    "program::", "_chain::", "live_page::", "live_session::", "other_models::", "catkin::", "closed_loop::",
    "debian_package::", "decoding_page::", "node_streams::", "uploaded_model::", "calibrated_model::", "the_job_for_ci",
    "impedances_", "few_electrodes_of_real_eeg", "filtered_eeg_equals", "the_thread_with_the_sockets",
    "offline_files::", "own_master::", "predictions::", "packed_loss::", "raw_forms::", "events_are_at_their_samples",
    "rosmaster_parity::", "real_ros::",
    // Tests that compare whole recordings with a reference, or train models.
    "an_evaluation_states", "people::", "a_packed_model_", "a_wanted_error", "streaming_equals_batch_on",
    "_numpy::", "packed_python::", "quantise::integer_codes", "synthetic_eeg::", "crossval::", "report::",
    // Tests that simulate minutes or hours.
    "synthetic::tests", "every_scenario_of_the_repository", "rates::stamps_follow", "codes::",
    "an_edge_is_at_most_a_row_from_its_place", "after_a_restart_at_any_phase",
    // Tests that wait for a time limit, or for what a board sends in real time.
    "trouble::", "machine::", "misbehaving_peers::", "duration::", "backlog::", "convert::",
    "gaps::", "names::", "record::", "replay::", "a_board_without_a_reader", "on_a_slow_disk",
    "a_terminal_can_be_closed", "a_model_is_used_only_if_all", "invalid_xml_slow_requests",
    "a_silent_client_is_closed",
];

/// Smallest number of tests to run in parallel, even on fewer cores: tests of the whole chain
/// mostly wait for samples.
const TESTS_IN_PARALLEL: usize = 6;

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
    ("build with lints, while packages and toolchains are installed", build_and_installation),
    ("lints for the microcontrollers", lints_for_microcontrollers),
    ("tests, with ROS and emulated microcontrollers, and the stages of `test --boards`", all_tests),
    ("virtual boards: images that are flashed, with the bridge", board::test_with_bridge),
    ("figures of docs/figures.md", docs::check),
];

/// Stages of `test --boards`, in the order in which they run. The scenarios with a bridge are not
/// among them, because the bridge waits in real time for what the emulator computes.
#[rustfmt::skip]
const BOARDS: &[Stage] = &[
    ("build with lints, while packages and toolchains are installed", build_and_installation),
    ("benchmarks on emulated microcontrollers", benchmarks),
    ("images for the boards", images_for_boards),
    ("virtual boards: models", board::models),
    ("virtual boards: images that are flashed, without the bridge", board::test_without_bridge),
];

/// Runs the stages, stops at the first failure, and prints the time of each stage at the end.
pub(crate) fn test(fast: bool, boards: bool) -> Result<(), Failure> {
    let stages = match (fast, boards) {
        (true, _) => FAST,
        (_, true) => BOARDS,
        _ => FULL,
    };
    let total = stages.len();
    print_skipped(fast);
    let start = Instant::now();
    let mut times = Vec::new();
    for (number, (name, stage)) in (1..).zip(stages) {
        eprintln!("\n[{number}/{total}] {name}");
        let stage_start = Instant::now();
        stage()?;
        let time = stage_start.elapsed();
        eprintln!("[{number}/{total}] {name}: passed in {}", minutes(time));
        times.push((*name, time));
    }
    times.push(("all stages", start.elapsed()));
    eprintln!("\n{}", table(&times));
    eprintln!("xtask test: all {total} stages passed");
    print_skipped(fast);
    Ok(())
}

/// Returns one line for each stage, with its time.
fn table(times: &[(&str, Duration)]) -> String {
    let line = |(name, time): &(&str, Duration)| format!("{name:<50} {:>12}\n", minutes(*time));
    times.iter().map(line).collect()
}

fn print_skipped(fast: bool) {
    if fast {
        eprintln!(
            "SKIPPED: the emulators, the benchmarks, models of other shapes, whole recordings, and \
             tests that start programs or ROS, simulate minutes, or wait: leave --fast out"
        );
    }
    if env::var_os("CORTICODE_DATA").is_none() {
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

/// Builds the workspace's programs and tests with clippy's driver. Meanwhile, installs what the
/// later stages need, which mostly waits for downloads. If the installation fails, prints its
/// message at once, not after the build.
fn build_and_installation() -> Result<(), Failure> {
    thread::scope(|scope| {
        let installation = scope.spawn(|| {
            install::install().inspect_err(|failure| eprintln!("error: {}", failure.message))
        });
        let build = |words| run(&mut linting_cargo(words), AFTER_A_LINT);
        let built = build("build --bins --tests --examples --workspace")
            .and_then(|()| build(BRIDGE_WITHOUT_ROS2));
        match installation.join() {
            Ok(installed) => installed.and(built),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

/// Returns a cargo command that lints the members of the workspace as it builds them: clippy's
/// driver compiles as rustc does. Any warning is an error.
fn linting_cargo(words: &str) -> Command {
    let mut cargo = cargo("--config=build.rustc-workspace-wrapper='clippy-driver'");
    cargo.args(words.split_whitespace());
    // Turn warnings into errors, as `cargo clippy -- -D warnings` does: it passes its arguments to
    // the driver in this variable.
    cargo.env("CLIPPY_ARGS", "-D__CLIPPY_HACKERY__warnings");
    cargo
}

/// Lints the selected packages for the microcontrollers' target, including code that is not
/// compiled for a PC. Uses the profile of the images, so that lints and images share compiled
/// macros and build scripts.
fn lints_for_target(model: Option<&Path>, selection: &str) -> Result<(), Failure> {
    let target = format!("--profile=firmware --target={BOARD_TARGET}");
    let mut lints = images::cargo_for(model, &format!("clippy {target} {selection}"));
    run(lints.args(["--", "-D", "warnings"]), AFTER_A_LINT)
}

/// Lints the crates of [`THUMB_CRATES`] with the kernels for each microcontroller, and every board
/// with each of its ports. The features of the two microcontrollers exclude each other, so each
/// image is a separate call of cargo.
fn lints_for_microcontrollers() -> Result<(), Failure> {
    for rig in [Rig::H743, Rig::F446, Rig::Ironbci] {
        for [name, selection] in rig.images() {
            // Lint these crates only once for each NUCLEO board, with its default image.
            let crates = if ["h743", "f446"].contains(name) { THUMB_CRATES } else { "" };
            let selection = format!("{crates} --package=board-stm32 {selection}");
            lints_for_target(rig.model().as_deref(), &selection)?;
        }
    }
    lints_for_target(None, &format!("--package=board-stm32 {F446_WITH_BOTH_ENCODERS}"))
}

/// Tests the default members of the workspace, except for [`SLOW_TESTS`] and examples in the
/// documentation. First builds the programs that tests start, from the same packages: otherwise
/// cargo would compile most crates twice, with different features.
fn fast_tests() -> Result<(), Failure> {
    run(&mut cargo("build --bins --tests"), AFTER_A_BUILD)?;
    let skipped = SLOW_TESTS.iter().map(|part| format!("--skip={part}"));
    let skipped: Vec<String> = skipped.collect();
    tests(&mut cargo(&format!("test --tests -- {}", skipped.join(" "))))
}

/// Runs the tests of all members of the workspace and, because many of them wait, the stages of
/// `test --boards` at the same time. When both have ended, prints the output of the stages, and
/// then the figures of the emulated microcontrollers.
fn all_tests() -> Result<(), Failure> {
    let log = target_folder().join("boards.log");
    eprintln!("output of `test --boards`, which runs meanwhile: {}", log.display());
    let output = File::create(&log).and_then(|file| Ok([file.try_clone()?, file]));
    let [stdout, stderr] = output.or_fail(log.display(), "is its folder writable?")?;
    // Run the boards with the lowest priority, so that they use only processor time that the tests
    // leave unused.
    let mut boards = Command::new("nice");
    boards.args(["-n", "19"]).arg(target_folder().join("debug/xtask"));
    boards.args(["test", "--boards"]).stdout(stdout).stderr(stderr);
    let boards_run = boards.spawn().or_fail(typed(&boards), "repeat the command");
    let mut boards_run = boards_run?;

    let mut test = linting_cargo("test --workspace");
    let figures = figures::attach(&mut test, "qemu", false);
    let tested = tests(test.env("CORTICODE_REQUIRE_ROS", "1"));

    let status = boards_run.wait().or_fail(typed(&boards), "repeat the command")?;
    eprint!("\n{}", fs::read_to_string(&log).unwrap_or_default());
    tested?;
    if !status.success() {
        return Err(Failure::check(typed(&boards), status, "read its message above"));
    }
    qemu::report(&figures, None, false)
}

/// Runs tests. The programs that the tests start are built already.
fn tests(test: &mut Command) -> Result<(), Failure> {
    let programs = target_folder().join("debug");
    let cores = thread::available_parallelism().map_or(1, usize::from);
    test.env("RUST_TEST_THREADS", cores.max(TESTS_IN_PARALLEL).to_string());
    run(test.env("CORTICODE_PROGRAMS", programs), AFTER_A_TEST)
}

fn benchmarks() -> Result<(), Failure> {
    let next = "compare with `git log` of the crates that it names";
    for benchmark in ["filters", "encoder", "packed", "lossless", "substitution"] {
        let mut report = Command::new(target_folder().join("debug/report"));
        docs::attach(&mut report, &format!("bench {benchmark}"))?;
        run(report.arg(benchmark), next)?;
    }
    Ok(())
}

fn images_for_boards() -> Result<(), Failure> {
    programs::link_vectors(Nucleo::H743)?;
    programs::link_vectors(Nucleo::F446)?;
    Rig::ALL.into_iter().try_for_each(images::build)?;
    let mut budget = Command::new(target_folder().join("debug/budget"));
    docs::attach(&mut budget, "budget")?;
    run(budget.arg(images::folder()), "see the message above")
}

fn minutes(time: Duration) -> String {
    let seconds = time.as_secs();
    format!("{} min {:>2} s", seconds / 60, seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_fails_the_build_with_lints() {
        let folder = env::temp_dir().join(format!("xtask-lint-{}", std::process::id()));
        let build = |source: &str| {
            fs::create_dir_all(folder.join("src")).expect("a folder");
            let manifest = "[package]\nname = 'linted'\nedition = '2024'\n[workspace]";
            fs::write(folder.join("Cargo.toml"), manifest).expect("a manifest");
            fs::write(folder.join("src/lib.rs"), source).expect("a source");
            let mut cargo = linting_cargo("build --offline");
            cargo.arg("--manifest-path").arg(folder.join("Cargo.toml"));
            cargo.arg("--target-dir").arg(folder.join("target"));
            cargo.output().expect("cargo")
        };
        let passed = build("/// Returns one.\npub fn one() -> u8 {\n    1\n}\n");
        // This code violates a lint that only warns by default.
        let failed = build("/// Returns one.\npub fn one() -> u8 {\n    return 1;\n}\n");
        fs::remove_dir_all(&folder).expect("the folder");
        assert!(passed.status.success(), "{passed:?}");
        let message = String::from_utf8_lossy(&failed.stderr);
        assert!(!failed.status.success() && message.contains("needless_return"), "{message}");
    }
}
