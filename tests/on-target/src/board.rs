//! Runs the image on a real board through its ST-LINK, with probe-rs; `cargo xtask hil --board`
//! starts this program.

use std::env;
use std::io::{BufRead, BufReader};
use std::process::{Command, ExitCode, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use on_target::results::{self, Line};

/// Each board's name on the command line, and probe-rs's name for its microcontroller.
const CHIPS: [(&str, &str); 2] = [("h743", "STM32H743ZITx"), ("f446", "STM32F446RETx")];

/// Time limit for the next line of output: more than flashing the image takes, and more than the
/// slowest vector at 16 MHz, the NUCLEO-F446RE's clock after a reset.
const SILENCE: Duration = Duration::from_mins(3);

/// Exit status if the arguments on the command line are missing or wrong.
const MISSING: u8 = 2;
/// Exit status if the image prints no result: probe-rs does not start, or no board responds.
const UNREACHABLE: u8 = 3;

/// Runs the image from the command line `on-target BOARD IMAGE`; returns an exit status.
pub(crate) fn run() -> ExitCode {
    let words: Vec<String> = env::args().skip(1).collect();
    let chip = |word: &str| CHIPS.into_iter().find(|(board, _)| *board == word);
    let (Some((_, chip)), [_, image]) = (words.first().and_then(|word| chip(word)), &words[..])
    else {
        return failure(
            MISSING,
            "no board and image in the arguments",
            "`cargo xtask hil --board h743`",
        );
    };
    println!("{chip}");
    let mut probe = Command::new("probe-rs");
    let mut lines = Vec::new();
    let ended = run_to_end(probe.args(["run", "--chip", chip]).arg(image), |line| {
        println!("  {}", results::readable(&line, "cycles", |ticks| ticks));
        lines.push(line);
    });
    match ended.and_then(|()| results::check(&lines)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) if lines.iter().any(|line| Line::parse(line).is_some()) => failure(
            1,
            &format!("the golden vectors on {chip} failed: {why}"),
            "run it again; the vectors are in tests/on-target/src",
        ),
        Err(why) => failure(
            UNREACHABLE,
            &format!(
                "the board with an {chip} is not reachable: its image has printed nothing: {why}"
            ),
            "attach the board's ST-LINK by USB; `probe-rs list` must show it, and its udev rule is at probe.rs",
        ),
    }
}

fn failure(status: u8, what: &str, next: &str) -> ExitCode {
    eprintln!("\nerror: {what}\n  next: {next}");
    status.into()
}

/// Runs a command to its end and calls `on_line` with each line that it prints. Kills a command
/// that prints no line for [`SILENCE`], and fails.
fn run_to_end(command: &mut Command, mut on_line: impl FnMut(String)) -> Result<(), String> {
    let spawned = command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
    let mut child = spawned.map_err(|error| error.to_string())?;
    let (sender, lines) = mpsc::channel();
    let output = child.stdout.take().map(BufReader::new);
    thread::spawn(move || {
        let mut all = output.into_iter().flat_map(BufRead::lines).map_while(Result::ok);
        all.try_for_each(|line| sender.send(line))
    });
    loop {
        match lines.recv_timeout(SILENCE) {
            Ok(line) => on_line(line),
            Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {
                // An error means that the command has already ended, which is harmless.
                let _ = child.kill();
                return Err(format!("silent for {} s", SILENCE.as_secs()));
            }
        }
    }
    let status = child.wait().map_err(|error| error.to_string())?;
    if status.success() { Ok(()) } else { Err(status.to_string()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_to_the_end_of_a_command_and_its_status_counts() {
        let mut lines = Vec::new();
        let mut command = Command::new("sh");
        let ended = run_to_end(command.args(["-c", "echo one; exit 3"]), |line| {
            lines.push(line);
        });
        assert_eq!(lines, ["one"]);
        assert_eq!(ended, Err("exit status: 3".to_owned()));
    }

    #[test]
    fn visual_studio_code_debugs_each_board_on_its_chip() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../.vscode/launch.json");
        let text = std::fs::read_to_string(path).expect("the configuration");
        let json: serde_json::Value = serde_json::from_str(&text).expect("JSON without remarks");
        let all = json["configurations"].as_array().expect("a list");
        let found = all.iter().map(|one| {
            let image = one["coreConfigs"][0]["programBinary"].as_str();
            let image = image.and_then(|path| path.rsplit('/').next());
            [one["request"].as_str(), one["chip"].as_str(), image]
                .map(|word| word.map(str::to_owned))
        });
        let wanted = CHIPS.into_iter().flat_map(|(board, chip)| {
            let image = format!("board-{board}");
            ["launch", "attach"].map(|way| [way, chip, &image].map(|word| Some(word.to_owned())))
        });
        assert_eq!(found.collect::<Vec<_>>(), wanted.collect::<Vec<_>>());
    }
}
