//! `cargo xtask board`: tests the images that are flashed on emulated boards.

use serde_json::{Value, json};

use crate::command::{
    AFTER_A_BUILD, Failure, cargo, replace, run, target_folder, virtual_board_cargo,
};
use crate::docs;
use crate::figures::{self, Figures, File, Row};
use crate::images::{self, Board};
use crate::install;

/// A board's truth values, each with the figures that must all be present, separated by blanks.
const VERDICTS: [(&str, &str); 3] = [
    (
        "reset_cause_ok",
        "reset_cause_hang reset_cause_panic reset_cause_fault reset_cause_overflow reset_cause_wild_stack",
    ),
    (
        "faults_named",
        "fault_dead_chip fault_late_power fault_silent_drdy fault_shifted_bit",
    ),
    ("bridge_connected", "bridge_codes bridge_selftest"),
];

/// Figures of every board, null if its test did not get as far as measuring them.
const ALWAYS: [&str; 6] = [
    "booted",
    "codes",
    "equal_to_host",
    "violations",
    "unmapped",
    "selftest_ok",
];

/// Builds the images and the bridge, runs the scenarios on one board or on both, and prints their figures.
///
/// # Errors
/// A toolchain is missing, a program does not build, or a scenario fails.
pub(crate) fn board(board: Option<Board>, json: bool) -> Result<(), Failure> {
    install::virtual_board_compiler()?;
    // All programs, as the acceptance tests build them: the bridge alone would have other features.
    run(&mut cargo("build --bins"), AFTER_A_BUILD)?;
    test(
        &board.map_or(Board::ALL.to_vec(), |board| vec![board]),
        json,
    )
}

/// Runs the scenarios of [`board`] with a bridge that is already built.
///
/// # Errors
/// An image does not build, or a scenario fails.
pub(crate) fn test(boards: &[Board], json: bool) -> Result<(), Failure> {
    let mut test = virtual_board_cargo("test --release --test boards --");
    test.env(
        "CORTICODE_BRIDGE",
        target_folder().join("debug/corticode-bridge"),
    );
    for board in boards {
        images::build(*board)?;
        test.arg(board.key());
        for [name, _] in board.images() {
            let variable = format!("CORTICODE_IMAGE_{}", name.to_uppercase().replace('-', "_"));
            test.env(variable, images::folder().join(name).with_extension("elf"));
        }
    }
    let file = File::new("board");
    let next = "run the failed test alone, as docs/bring-up.md has it under \"Reproduce a fault on a \
                virtual board\"";
    let passed = run(file.attach(&mut test, json), next);
    let figures = file.read("board")?;
    let rows: Vec<Row> = boards
        .iter()
        .map(|board| row(board.key(), &figures))
        .collect();
    let object = json!({"boards": rows, "passed": passed.is_ok()});
    docs::save("board", &object)?;
    if json {
        println!("{object}");
    } else {
        for (board, row) in boards.iter().zip(&rows) {
            figures::print_table(board.key(), row);
        }
    }
    passed
}

/// Runs a board whose link is at a TCP port, until Ctrl-C.
///
/// # Errors
/// A toolchain is missing, or the image or the emulated board does not build.
pub(crate) fn live(board: Board, port: u16, other_port: bool) -> Result<(), Failure> {
    install::virtual_board_compiler()?;
    images::build(board)?;
    let [[other, _], [default, _]] = board.images();
    let image = images::folder().join(if other_port { other } else { default });
    let cable = if (board == Board::H743) == other_port {
        "uart"
    } else {
        "usb"
    };
    let words = format!(
        "run --release --quiet -- {} --port {port} --cable {cable}",
        board.key()
    );
    replace(
        virtual_board_cargo(&words)
            .arg("--image")
            .arg(image.with_extension("elf")),
    )
}

/// Lints the emulated boards' own workspace and runs its tests: models of the hardware that the emulator
/// lacks, and invalid input.
///
/// # Errors
/// A lint fires, or a test fails.
pub(crate) fn models() -> Result<(), Failure> {
    let lints = "clippy --release --all-targets -- -D warnings";
    run(
        &mut virtual_board_cargo(lints),
        "mend what clippy names above",
    )?;
    let next = "a model of the emulated board is wrong, or a message: run the failed test alone";
    run(
        &mut virtual_board_cargo("test --release --lib --bins --test command_line"),
        next,
    )
}

/// Returns the figures of a board. Those of its image with the other port start with that port's name.
fn row(board: &str, figures: &Figures) -> Row {
    let mut row: Row = ALWAYS
        .map(|key| (key.to_owned(), Value::Null))
        .into_iter()
        .collect();
    for (name, values) in &figures.rows {
        if let Some(port) = name.strip_prefix(board) {
            let prefix = port
                .strip_prefix('-')
                .map(|port| format!("{port}_"))
                .unwrap_or_default();
            row.extend(
                values
                    .iter()
                    .map(|(key, value)| (format!("{prefix}{key}"), value.clone())),
            );
        }
    }
    for (verdict, keys) in VERDICTS {
        let holds = keys.split(' ').all(|key| row.contains_key(key));
        row.insert(verdict.to_owned(), holds.into());
    }
    row.insert("board".to_owned(), board.into());
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_test_has_written_down_is_null_and_its_verdict_is_false() {
        let row = row("f446", &Figures::default());
        assert!(ALWAYS.iter().all(|key| row[*key] == Value::Null));
        assert!(VERDICTS.iter().all(|(verdict, _)| row[*verdict] == false));
    }

    #[test]
    fn a_verdict_needs_all_of_its_figures_and_the_other_image_is_named_by_its_port() {
        let some = r#"{"board":"h743","fault_dead_chip":true}
{"board":"h743-uart","codes":256}
{"board":"f446","codes":7}"#;
        let some = Figures::parse(some, "board").expect("figures");
        let row = row("h743", &some);
        assert_eq!(row["faults_named"], Value::from(false));
        assert_eq!(
            (&row["codes"], &row["uart_codes"]),
            (&Value::Null, &Value::from(256))
        );
    }
}
