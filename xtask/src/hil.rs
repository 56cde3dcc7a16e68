//! `cargo xtask hil`: a microcontroller checks the golden vectors itself; emulated, or a board.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use crate::command::{
    AFTER_A_BUILD, BOARD_TARGET, Failure, cargo, replace, run, succeeds, target_folder,
};
use crate::images::Board;
use crate::install;

/// Longest time from one vector's end to the next one's on a board that runs at 16 MHz, and to flash it.
const SILENCE: Duration = Duration::from_mins(3);

/// Runs the vectors on both emulated microcontrollers, or on a board.
///
/// # Errors
/// The target, probe-rs or the board is missing, the image does not build, or a vector fails.
pub(crate) fn hil(board: Option<Board>) -> Result<(), Failure> {
    install::board_target()?;
    match board {
        None => replace(&mut cargo(
            "test --package emulated --test golden_vectors -- --nocapture",
        )),
        Some(board) => on_board(board),
    }
}

/// Links the image of a board.
///
/// # Errors
/// The image does not build, or is too large for the board.
pub(crate) fn link(board: Board) -> Result<(), Failure> {
    let build = "build --package=on-target --bin=on-target --profile=firmware";
    let words = format!("{build} --target={BOARD_TARGET} --features={}", board.key());
    run(&mut cargo(&words), AFTER_A_BUILD)
}

fn on_board(board: Board) -> Result<(), Failure> {
    if !succeeds(Command::new("probe-rs").arg("--version")) {
        let next = "`cargo install probe-rs-tools --version 0.32.0 --locked`";
        return Err(Failure::missing(
            "probe-rs",
            "`probe-rs --version` does not run",
            next,
        ));
    }
    link(board)?;
    println!("{}", board.chip());
    let image = target_folder()
        .join(BOARD_TARGET)
        .join("firmware/on-target");
    let mut lines = Vec::new();
    let mut probe = Command::new("probe-rs");
    let ended = run_to_end(
        probe.args(["run", "--chip", board.chip()]).arg(image),
        |line| {
            println!("  {}", shown(&line));
            lines.push(line);
        },
    );
    let Err(why) = ended.and_then(|()| check(&lines)) else {
        return Ok(());
    };
    if lines.iter().any(|line| is_result(line)) {
        let what = format!("the golden vectors on {}", board.chip());
        return Err(Failure::check(
            what,
            why,
            "run it again; the vectors are in tests/on-target/src",
        ));
    }
    Err(Failure::unreachable(
        format!("the board with an {}", board.chip()),
        format!("its image has printed nothing: {why}"),
        "attach the board's ST-LINK by USB; `probe-rs list` must show it, and its udev rule is at probe.rs",
    ))
}

/// Runs a command, calls `line` with each line it prints, and ends it after [`SILENCE`] without one.
fn run_to_end(command: &mut Command, mut line: impl FnMut(String)) -> Result<(), String> {
    let spawned = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
    let mut child = spawned.map_err(|error| error.to_string())?;
    let (sender, lines) = mpsc::channel();
    let output = child.stdout.take().map(BufReader::new);
    thread::spawn(move || {
        let mut all = output
            .into_iter()
            .flat_map(BufRead::lines)
            .map_while(Result::ok);
        all.try_for_each(|line| sender.send(line))
    });
    loop {
        match lines.recv_timeout(SILENCE) {
            Ok(text) => line(text),
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {
                // Fails if it has just ended by itself.
                let _ = child.kill();
                return Err(format!("silent for {} s", SILENCE.as_secs()));
            }
        }
    }
    let status = child.wait().map_err(|error| error.to_string())?;
    if status.success() {
        Ok(())
    } else {
        Err(status.to_string())
    }
}

/// Ticks and name of a vector that has passed.
fn passed(line: &str) -> Option<(u64, &str)> {
    let (ticks, vector) = line.strip_prefix("passed ")?.split_once(' ')?;
    Some((ticks.parse().ok()?, vector))
}

/// Returns whether the image prints such a line; other lines are those of probe-rs.
fn is_result(line: &str) -> bool {
    let is_end = line.contains(" vectors, ") && line.ends_with(" failed");
    passed(line).is_some() || line.starts_with("FAILED ") || is_end
}

/// The line as it is printed: on a board a tick is a cycle.
fn shown(line: &str) -> String {
    passed(line).map_or_else(
        || line.to_owned(),
        |(ticks, vector)| format!("passed  {vector:36} {ticks:>11} cycles"),
    )
}

/// Checks that the image has reached its end and counts all its vectors as passed. An exit status of 0 is not
/// enough: a run that the user ends with Ctrl-C has it, too.
fn check(lines: &[String]) -> Result<(), String> {
    let vectors = lines.iter().filter(|line| passed(line).is_some()).count();
    let end = lines.iter().rfind(|line| is_result(line));
    if vectors > 0 && end.is_some_and(|end| *end == format!("{vectors} vectors, 0 failed")) {
        return Ok(());
    }
    Err(format!(
        "{vectors} passed, and the image did not print at its end that these are all"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::root;

    #[test]
    fn only_an_image_that_counts_all_its_vectors_as_passed_is_well() {
        let passes = |lines: &[&str]| {
            let lines: Vec<String> = lines.iter().map(|&line| line.to_owned()).collect();
            check(&lines).is_ok()
        };
        let [first, second] = ["passed 70 filters, 512 Hz", "passed 80 network's sum"];
        assert!(passes(&[first, second, "2 vectors, 0 failed"]));
        assert!(passes(&["a warning", first, "1 vectors, 0 failed"]));
        assert!(!passes(&[first, second]));
        assert!(!passes(&[first, "2 vectors, 0 failed"]));
        assert!(!passes(&[first, "FAILED x: y", "2 vectors, 1 failed"]));
        assert!(!passes(&["0 vectors, 0 failed"]));
        assert!(!passes(&[]));
    }

    #[test]
    fn ticks_are_printed_as_cycles() {
        let line = shown("passed 2560 network's sum");
        assert!(line.starts_with("passed  network's sum "), "{line}");
        assert!(line.ends_with(" 2560 cycles"), "{line}");
        assert_eq!(shown("something else"), "something else");
    }

    #[test]
    fn lines_are_read_to_the_end_of_a_command_and_its_status_counts() {
        let mut lines = Vec::new();
        let mut command = Command::new("sh");
        let ended = run_to_end(command.args(["-c", "echo one; exit 3"]), |line| {
            lines.push(line)
        });
        assert_eq!(
            (&lines[..], ended),
            (&["one".to_owned()][..], Err("exit status: 3".to_owned()))
        );
    }

    #[test]
    fn visual_studio_code_debugs_each_board_on_its_chip() {
        let path = root().join(".vscode/launch.json");
        let text = std::fs::read_to_string(path).expect("the configuration");
        let json: serde_json::Value = serde_json::from_str(&text).expect("JSON without remarks");
        let all = json["configurations"].as_array().expect("a list");
        let found = all.iter().map(|one| {
            let image = one["coreConfigs"][0]["programBinary"].as_str();
            let image = image.and_then(|path| path.rsplit('/').next());
            [one["request"].as_str(), one["chip"].as_str(), image]
                .map(|word| word.map(str::to_owned))
        });
        let wanted = Board::ALL.into_iter().flat_map(|board| {
            let image = format!("board-{}", board.key());
            ["launch", "attach"]
                .map(|way| [way, board.chip(), &image].map(|word| Some(word.to_owned())))
        });
        assert_eq!(found.collect::<Vec<_>>(), wanted.collect::<Vec<_>>());
    }
}
