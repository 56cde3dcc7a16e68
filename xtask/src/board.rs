//! `cargo xtask board`: tests, on emulated boards, the images that are flashed to real ones.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::command::{
    AFTER_A_BUILD, Failure, cargo, replace, run, target_folder, virtual_board_cargo,
};
use crate::figures::{self, Figures, Row};
use crate::images::{self, ARTIFACT, Board, Rig};
use crate::install;

/// Figures that summarise a group of figures: true if the row of a board has all of them, false if
/// it has only some, and null if it has none. Each entry has the summary's name, the common start
/// of the names in the group, and their different ends, separated by blanks.
#[rustfmt::skip]
const VERDICTS: [[&str; 3]; 3] = [
    ["reset_cause_ok", "reset_cause_", "hang panic fault overflow wild_stack"],
    ["faults_named", "fault_", "dead_chip late_power silent_drdy shifted_bit"],
    ["bridge_connected", "bridge_", "codes selftest"],
];

/// Names of the figures that every board's row has, separated by blanks; a figure that was not
/// measured is null.
const ALWAYS: &str = "booted codes equal_to_host violations unmapped selftest_ok";

/// Name under which the figures are saved, and name of the member of each row that holds the
/// board's name.
const FIGURES: &str = "board";

/// Prefix of the names of the scenarios with a bridge.
const WITH_BRIDGE: &str = "bridge_";

const AFTER_A_SCENARIO: &str = "run the failed test alone, as docs/bring-up.md has it under \"Reproduce a fault on a \
                                virtual board\"";

/// Builds the images and the bridge, runs the scenarios on `rig` (on all rigs if `None`), and
/// prints the figures.
pub(crate) fn board(rig: Option<Rig>, json: bool) -> Result<(), Failure> {
    install::virtual_board_compiler()?;
    // Build all programs, as the acceptance tests do. For the bridge alone, cargo would select
    // other features of its dependencies and compile them again.
    run(cargo("build --bins").env_remove(ARTIFACT), AFTER_A_BUILD)?;
    let rigs = rig.map_or(Rig::ALL.to_vec(), |rig| vec![rig]);
    rigs.iter().copied().try_for_each(images::build)?;
    let mut test = scenarios(&rigs);
    for rig in &rigs {
        test.arg(rig.key().replace('-', "_"));
    }
    let file = figures::attach(&mut test, FIGURES, json);
    let passed = run(&mut test, AFTER_A_SCENARIO);
    publish(&rigs, &file, passed, json)
}

/// Runs the scenarios without a bridge on all rigs, whose images must be built.
/// [`test_with_bridge`] prints their figures.
pub(crate) fn test_without_bridge() -> Result<(), Failure> {
    let mut test = scenarios(&Rig::ALL);
    figures::attach(&mut test, FIGURES, false);
    run(test.args(["--skip", WITH_BRIDGE]), AFTER_A_SCENARIO)
}

/// Runs the scenarios with a bridge on all rigs; the bridge waits in real time for the emulator.
/// Prints their figures and those of [`test_without_bridge`], which must have run before.
pub(crate) fn test_with_bridge() -> Result<(), Failure> {
    let mut test = scenarios(&Rig::ALL);
    let file = figures::attach_again(&mut test, FIGURES);
    let passed = run(test.arg(WITH_BRIDGE), AFTER_A_SCENARIO);
    publish(&Rig::ALL, &file, passed, false)
}

/// Returns the command that runs all scenarios on `rigs`; their images and a bridge must be built.
fn scenarios(rigs: &[Rig]) -> Command {
    let mut test = linted("test --release --test boards --");
    let bridge = target_folder().join("debug/corticode-bridge");
    test.env("CORTICODE_BRIDGE", bridge);
    // The scenarios compare with a host-sim of the built-in model.
    test.env_remove(ARTIFACT);
    for rig in rigs {
        for [name, _] in rig.images() {
            let word = name.to_uppercase().replace('-', "_");
            test.env(format!("CORTICODE_IMAGE_{word}"), images::file(name));
            if let Some(model) = rig.model() {
                test.env(format!("CORTICODE_MODEL_{word}"), model);
            }
        }
    }
    test
}

/// Reads the figures of `rigs` from `file`, prints them and saves them. Call this after the last
/// scenario.
fn publish(
    rigs: &[Rig],
    file: &Path,
    passed: Result<(), Failure>,
    json: bool,
) -> Result<(), Failure> {
    let figures = figures::read(file, FIGURES)?;
    let rows = rigs.iter().map(|rig| row(rig.key(), &figures));
    let whole = Row::from_iter([("passed".to_owned(), passed.is_ok().into())]);
    figures::publish(FIGURES, FIGURES, rows.collect(), whole, json)?;
    passed
}

/// Runs an emulated board until Ctrl-C, with its link on TCP port `port`. `other_port` selects the
/// image for the link (USB or UART) that is not the board's default. The model is the rig's own,
/// unless `CORTICODE_ARTIFACT` names another.
pub(crate) fn live(rig: Rig, port: u16, other_port: bool) -> Result<(), Failure> {
    let mut images = rig.images().iter().map(|[name, _]| *name);
    let (first, default) = (images.next(), images.next_back());
    if other_port && default.is_none() {
        return Err(Failure::missing(
            "an image for the other port",
            format!("{} has one port", rig.key()),
            "leave --other-port out, or take h743 or f446",
        ));
    }
    install::virtual_board_compiler()?;
    let chosen = if other_port { first } else { default.or(first) };
    let chosen = chosen.unwrap_or(rig.key());
    let own = env::var_os(ARTIFACT).map(PathBuf::from);
    let folder = if let Some(model) = &own {
        images::build_with(rig, chosen, model)?
    } else {
        images::build(rig)?;
        images::folder()
    };
    let model = own.or_else(|| rig.model());
    let image = folder.join(chosen).with_extension("elf");
    let is_uart = (rig.board() == Board::H743) == other_port;
    let cable = if is_uart { "uart" } else { "usb" };
    let key = rig.board().key();
    let words = format!("run --release -- {key} --port {port} --cable {cable}");
    let mut live = virtual_board_cargo(&words);
    if let Some(model) = model {
        live.arg("--artifact").arg(model);
    }
    replace(live.env_remove(ARTIFACT).arg("--image").arg(image))
}

/// Lints the workspace of the emulated boards, and tests its models of peripherals and its command
/// line.
pub(crate) fn models() -> Result<(), Failure> {
    run(&mut linted("test --release --no-run"), "mend what clippy names above")?;
    let mut tests = linted("test --release --lib --bins --test command_line");
    let next = "a model of the emulated board is wrong, or a message: run the failed test alone";
    run(&mut tests, next)
}

/// Returns a cargo command in the workspace of the emulated boards that lints what it builds.
/// clippy's driver compiles as rustc does, so `cargo clippy` need not build the emulator again.
fn linted(words: &str) -> Command {
    let mut cargo = virtual_board_cargo(words);
    cargo.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver");
    cargo
}

/// Returns one row with the figures of a rig. Figures of the image for the board's other port start
/// with the port's name, such as `uart_codes`.
fn row(board: &str, figures: &Figures) -> Row {
    let nothing = ALWAYS.split(' ').map(|key| (key.to_owned(), Value::Null));
    let mut row: Row = nothing.collect();
    for (image, values) in figures {
        let Some(port) = image.strip_prefix(board) else {
            continue;
        };
        for (key, value) in values.iter().filter(|(key, _)| *key != "board") {
            let key = match port.strip_prefix('-') {
                Some(port) => format!("{port}_{key}"),
                None => key.clone(),
            };
            row.insert(key, value.clone());
        }
    }
    for [verdict, start, rests] in VERDICTS {
        let is_there = |rest| row.contains_key(&format!("{start}{rest}"));
        // A rig without any scenario of the group has no verdict.
        let all = rests.split(' ').all(is_there);
        let holds = rests.split(' ').any(is_there).then_some(all);
        row.insert(verdict.to_owned(), holds.into());
    }
    row.insert("board".to_owned(), board.into());
    row
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_board_has_its_own_figures_and_a_verdict_needs_all_of_its() {
        let figure = |key: &str, value: Value| Row::from_iter([(key.to_owned(), value)]);
        let figures = Figures::from([
            ("h743".to_owned(), figure("fault_dead_chip", true.into())),
            ("h743-uart".to_owned(), figure("codes", 256.into())),
            ("f446".to_owned(), figure("codes", 7.into())),
        ]);
        let expected = json!({
            "board": "h743", "fault_dead_chip": true, "uart_codes": 256,
            "booted": null, "codes": null, "equal_to_host": null,
            "violations": null, "unmapped": null, "selftest_ok": null,
            "reset_cause_ok": null, "faults_named": false, "bridge_connected": null,
        });
        assert_eq!(Value::Object(row("h743", &figures)), expected);
    }
}
