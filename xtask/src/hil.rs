//! `cargo xtask hil`: a microcontroller checks the golden vectors itself; emulated, or a board.

use std::process::Command;
use std::time::Duration;

use clap::{Args, ValueEnum};

use crate::benchmark::emulator::{self, Image, MACHINES, Machine};
use crate::command::succeeds;
use crate::failure::Failure;

/// The package of the image, and the image.
const IMAGE: &str = "on-target";

/// One instruction lasts 2^10 ns of the machine's time, which is 25.6 ticks of 25 MHz.
const VIRTUAL_TIME: &str = "shift=10,sleep=off";
const TICKS_OF_TEN: u64 = 256;

/// From one vector's end to the next one's, and starting QEMU on a busy PC.
const PATIENCE: Duration = Duration::from_mins(1);
/// The same on a board that runs at 16 MHz, and flashing it.
const PATIENCE_WITH_BOARD: Duration = Duration::from_mins(3);

/// What runs an image on a board, and how it is installed.
const PROBE_RS: &str = "probe-rs";
const INSTALL_PROBE_RS: &str = "`cargo install probe-rs-tools --version 0.32.0 --locked`";

/// What the verb can be told.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct HilOptions {
    /// Run on this board, attached by its ST-LINK, instead of on emulated microcontrollers.
    #[arg(long, value_enum)]
    board: Option<Board>,
}

impl HilOptions {
    /// On the emulated microcontrollers.
    pub(crate) const EMULATED: Self = Self { board: None };
}

/// A board that can run the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// NUCLEO-H743ZI2.
    H743,
    /// NUCLEO-F446RE.
    F446,
}

impl Board {
    const ALL: [Self; 2] = [Self::H743, Self::F446];

    /// probe-rs' name of its microcontroller.
    const fn chip(self) -> &'static str {
        match self {
            Self::H743 => "STM32H743ZITx",
            Self::F446 => "STM32F446RETx",
        }
    }

    /// What cargo is told so that the image is one for this board.
    const fn feature(self) -> &'static str {
        match self {
            Self::H743 => "--features=h743",
            Self::F446 => "--features=f446",
        }
    }
}

/// Builds the image and runs it on both emulated machines, or on a board.
///
/// # Errors
/// QEMU, the target, probe-rs or the board is missing, the image does not build, or a vector fails.
pub(crate) fn hil(options: HilOptions) -> Result<(), Failure> {
    match options.board {
        None => MACHINES.into_iter().try_for_each(on_emulator),
        Some(board) => on_board(board),
    }
}

/// Links the image of each board, so that it fits when somebody has one.
///
/// # Errors
/// An image does not build, or is too large for its board.
pub(crate) fn link_for_boards() -> Result<(), Failure> {
    Board::ALL
        .into_iter()
        .try_for_each(|board| Image::build(IMAGE, IMAGE, &[board.feature()]).map(drop))
}

fn on_emulator(machine: Machine) -> Result<(), Failure> {
    let image = Image::build(IMAGE, IMAGE, machine.features)?;
    println!("{}, {} (emulated)", machine.name, machine.core);
    let mut command = image.command(machine, image.target_folder(), &[IMAGE]);
    command.args(["-icount", VIRTUAL_TIME]);
    let said = emulator::run_to_end(&mut command, PATIENCE, |line| {
        println!(
            "  {}",
            shown(line, "instructions", |ticks| ticks * 10 / TICKS_OF_TEN)
        );
    })?;
    judge(machine.name, &said)
}

fn on_board(board: Board) -> Result<(), Failure> {
    if !succeeds(Command::new(PROBE_RS).arg("--version")) {
        return Err(Failure::Missing {
            what: PROBE_RS.to_owned(),
            why: format!("`{PROBE_RS} --version` does not run"),
            next: INSTALL_PROBE_RS.to_owned(),
        });
    }
    let image = Image::build(IMAGE, IMAGE, &[board.feature()])?;
    println!("{}", board.chip());
    let mut command = Command::new(PROBE_RS);
    command
        .args(["run", "--chip", board.chip()])
        .arg(image.path());
    let mut any = false;
    let outcome = emulator::run_to_end(&mut command, PATIENCE_WITH_BOARD, |line| {
        any |= Said::of(line).is_some();
        println!("  {}", shown(line, "cycles", |ticks| ticks));
    });
    match outcome {
        Ok(said) => judge(board.chip(), &said),
        Err(failure) if any => Err(failure),
        Err(failure) => Err(Failure::Unreachable {
            what: format!("the board with an {}", board.chip()),
            why: format!("its image has said nothing: {failure}"),
            next: "attach the board's ST-LINK by USB; `probe-rs list` must show it, and its udev rule \
                   is at probe.rs"
                .to_owned(),
        }),
    }
}

/// What an image says in a line; `None` of what is not its own.
#[derive(Debug, PartialEq, Eq)]
enum Said<'l> {
    Passed { ticks: u64, vector: &'l str },
    Failed,
    End { vectors: usize, failed: usize },
}

impl<'l> Said<'l> {
    fn of(line: &'l str) -> Option<Self> {
        if line.starts_with("FAILED ") {
            return Some(Self::Failed);
        }
        if let Some(rest) = line.strip_prefix("passed ") {
            let (ticks, vector) = rest.split_once(' ')?;
            let ticks = ticks.parse().ok()?;
            return Some(Self::Passed { ticks, vector });
        }
        let (vectors, failed) = line.split_once(" vectors, ")?;
        Some(Self::End {
            vectors: vectors.parse().ok()?,
            failed: failed.strip_suffix(" failed")?.parse().ok()?,
        })
    }
}

/// A line for a person, with ticks as what they are.
fn shown(line: &str, unit: &str, of_ticks: impl Fn(u64) -> u64) -> String {
    match Said::of(line) {
        Some(Said::Passed { ticks, vector }) => {
            format!("passed  {vector:36} {:>11} {unit}", of_ticks(ticks))
        }
        _ => line.to_owned(),
    }
}

/// Whether the image has come to its end and every vector has passed. An exit status of 0 is not enough:
/// a run that somebody ends with Ctrl-C has it, too.
fn judge(place: &str, said: &[String]) -> Result<(), Failure> {
    let said: Vec<Said<'_>> = said.iter().filter_map(|line| Said::of(line)).collect();
    let passed = said
        .iter()
        .filter(|said| matches!(said, Said::Passed { .. }));
    let passed = passed.count();
    let all = Said::End {
        vectors: passed,
        failed: 0,
    };
    if passed > 0 && said.last() == Some(&all) {
        return Ok(());
    }
    Err(Failure::Check {
        what: format!("the golden vectors on {place}"),
        why: format!("{passed} passed, and the image did not say at its end that these are all"),
        next: "run it again; the vectors are in tests/on-target/src".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::root;

    fn judged(lines: &[&str]) -> bool {
        let lines: Vec<String> = lines.iter().map(|&line| line.to_owned()).collect();
        judge("a place", &lines).is_ok()
    }

    #[test]
    fn only_an_image_that_counts_all_its_vectors_as_passed_is_well() {
        let [first, second] = ["passed 70 filters, 512 Hz", "passed 80 network's sum"];
        assert!(judged(&[first, second, "2 vectors, 0 failed"]));
        assert!(judged(&["a warning", first, "1 vectors, 0 failed"]));
        assert!(!judged(&[first, second]));
        assert!(!judged(&[first, "2 vectors, 0 failed"]));
        assert!(!judged(&[first, "FAILED x: y", "2 vectors, 1 failed"]));
        assert!(!judged(&["0 vectors, 0 failed"]));
        assert!(!judged(&[]));
    }

    #[test]
    fn visual_studio_code_debugs_each_board_on_its_chip() {
        let path = root().join(".vscode/launch.json");
        let text = std::fs::read_to_string(path).expect("the configuration");
        let json: serde_json::Value = serde_json::from_str(&text).expect("JSON without remarks");
        let all = json["configurations"].as_array().expect("a list");
        let found: Vec<_> = all
            .iter()
            .map(|one| {
                let image = one["coreConfigs"][0]["programBinary"].as_str();
                let image = image.expect("an image").rsplit('/').next();
                [one["request"].as_str(), one["chip"].as_str(), image]
            })
            .collect();
        let boards = [(Board::H743, "board-h743"), (Board::F446, "board-f446")];
        let wanted: Vec<_> = boards
            .into_iter()
            .flat_map(|(board, image)| {
                ["launch", "attach"].map(|way| [way, board.chip(), image].map(Some))
            })
            .collect();
        assert_eq!(found, wanted);
    }

    #[test]
    fn ticks_are_shown_as_what_they_are() {
        let line = shown("passed 2560 network's sum", "instructions", |ticks| {
            ticks / 256
        });
        assert!(line.starts_with("passed  network's sum "), "{line}");
        assert!(line.ends_with(" 10 instructions"), "{line}");
        assert_eq!(
            shown("something else", "cycles", |ticks| ticks),
            "something else"
        );
    }
}
