//! The command line: help, shell completions, and manual pages.

use std::path::Path;
use std::process::Command;

use crate::board::assert_has;
use crate::process::Bridge;

#[test]
fn wrong_usage_is_status_2_with_advice() {
    for (arguments, expected) in [
        (&["--port", "tcp:nowhere"][..], "tcp:127.0.0.1:5555"),
        (&["--port", "/dev/null", "--mains", "55"], "50 or 60"),
        (&["--port", "/dev/null", "--baud", "0"], "--baud"),
        (&["--port", "tcp:localhost:99999"], "0 to 65535"),
        (&["--port", "99999"], "write tcp:HOST:PORT"),
        (&["--port", "file:x"], "corticode-bridge replay x"),
        (&["selftest", "--port", "localhost:5555"], "write tcp:HOST:PORT"),
        (&["--port", "/tmp", "--sink", "ndjson"], "it is a folder"),
        (&["selftest", "--port", "/tmp"], "it is a folder"),
        (&["selftest", "--port", "/dev/null"], "/dev/ttyACM0"),
        (&["reset", "--port", "tcp:nowhere"], "tcp:127.0.0.1:5555"),
        (&["--port=x", "--streams", "codes,spectra"], "filtered"),
        (&["--port=x", "--announce=raw"], "--streams codes,raw"),
        (&["replay", "x", "--output", "tcp:h:99999"], "0 to 65535"),
        (&["replay", "x", "--output", "/tmp"], "write pty:PATH"),
        (&["replay", "x", "--output", "file:x"], "write pty:PATH"),
        (&["master", "--bind", "127.0.0.1:99999"], "0 to 65535"),
        (&["_prot:=/dev/null"], "known are port, baud"),
        (&["_port:=tcp:nowhere"], "tcp:127.0.0.1:5555"),
        (&["--port", "/dev/null", "--model", "/nowhere"], "model.toml"),
        (&["--port", "/etc/passwd", "--sink", "ndjson"], "/dev/ttyACM0"),
        (&["--port", "/dev/null", "--sink", "ndjson"], "/dev/ttyACM0"),
        (&["--port", "/dev/null", "--ros-master-uri", "nonsense"], "ROS_MASTER_URI"),
    ] {
        let log = Bridge::start(arguments).failure(2);
        assert!(log.contains(expected), "{arguments:?}: {log}");
    }
}

#[test]
fn an_empty_variable_sets_no_option() {
    let arguments = ["selftest", "--port", "/nowhere"];
    let log = Bridge::start_with(&arguments, &[("CORTICODE_BAUD", "")]).failure(3);
    assert!(log.contains("/nowhere does not open"), "{log}");
    Bridge::start_with(&arguments, &[("CORTICODE_BAUD", "0")]).failure(2);
}

#[test]
fn the_udev_rule_comes_with_the_program() {
    let rule = stdout(&["ports", "--udev-rule"]);
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../packaging/60-corticode.rules");
    assert_eq!(rule, std::fs::read_to_string(file).unwrap());
}

#[test]
fn a_reader_that_has_gone_changes_no_status() {
    for (arguments, status) in [
        (&["ports", "--json"][..], 0),
        (&["completions", "bash"], 0),
        (&["convert", "/none", "--to", "csv"], 2),
        (&["record", "/none/a.wire", "--port", "/none"], 2),
    ] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let other = writer.try_clone().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_corticode-bridge"));
        let ended = command.args(arguments).stdout(writer).stderr(other).status();
        assert_eq!(ended.unwrap().code(), Some(status), "{arguments:?}");
    }
}

fn stdout(arguments: &[&str]) -> String {
    let (status, text, log) = Bridge::start(arguments).output();
    assert_eq!(status, Some(0), "{arguments:?}: {log}");
    text
}

/// Returns the completions that bash offers for the last of `words`, using the script at `script`.
fn completed(script: &Path, words: &str) -> Vec<String> {
    let commands = r#"
        source "$1"
        read -r -a COMP_WORDS <<< "$2"
        COMP_CWORD=$(( ${#COMP_WORDS[@]} - 1 ))
        COMP_LINE=$2 COMP_POINT=${#COMP_LINE}
        function=$(complete -p corticode-bridge | sed 's/.*-F \([^ ]*\).*/\1/')
        "$function" corticode-bridge "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
        printf '%s\n' "${COMPREPLY[@]}"
    "#;
    let mut bash = Command::new("bash");
    bash.args(["--norc", "--noprofile", "-c", commands, "bash"]);
    let output = bash.arg(script).arg(words).output().expect("bash starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{errors}");
    let words = String::from_utf8(output.stdout).unwrap();
    words.lines().map(str::to_owned).collect()
}

#[test]
fn bash_completes_subcommands_options_and_values() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("corticode-bridge");
    std::fs::write(&script, stdout(&["completions", "bash"])).unwrap();
    let checked = Command::new("bash").arg("-n").arg(&script).status();
    assert!(checked.unwrap().success());
    assert_eq!(completed(&script, "corticode-bridge self"), ["selftest"]);
    assert_eq!(completed(&script, "corticode-bridge --fil"), ["--filler"]);
    let values = completed(&script, "corticode-bridge --announce r");
    assert_eq!(values, ["reconstructed", "raw"]);
    let options = completed(&script, "corticode-bridge record --");
    for option in ["--port", "--streams", "--config"] {
        assert!(options.iter().any(|known| known == option), "{options:?}");
    }
    assert!(!options.contains(&"--filler".to_owned()), "{options:?}");
}

#[test]
fn every_shell_has_a_script_that_names_the_program() {
    for (shell, expected) in [
        ("bash", "complete -F"),
        ("zsh", "#compdef corticode-bridge"),
        ("fish", "complete -c corticode-bridge"),
    ] {
        let script = stdout(&["completions", shell]);
        assert_has(&script, [expected, "event-stamps"]);
    }
    let log = Bridge::start(&["completions", "csh"]).failure(2);
    assert!(log.contains("bash") && log.contains("zsh"), "{log}");
}

/// Returns the names of the long options in a help text.
fn names(help: &str) -> Vec<String> {
    let lines = help.lines().map(str::trim_start);
    let options = lines.filter(|line| line.starts_with('-'));
    let options = options.map(|line| line.trim_start_matches("-h, ").trim_start_matches("-V, "));
    let ends = |letter: char| !letter.is_ascii_alphanumeric() && letter != '-';
    options.map(|line| line.split(ends).next().unwrap().to_owned()).collect()
}

#[test]
fn there_is_a_manual_page_for_each_command_that_names_every_option() {
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("share/man/man1");
    stdout(&["man", "--folder", pages.to_str().unwrap()]);
    let main = std::fs::read_to_string(pages.join("corticode-bridge.1")).unwrap();
    assert_eq!(stdout(&["man"]), main);
    let help = stdout(&["--help"]);
    let (_, commands) = help.split_once("Commands:\n").unwrap();
    let (commands, _) = commands.split_once("Options:\n").unwrap();
    let names_of_commands = commands.lines().filter_map(|line| {
        let line = line.strip_prefix("  ")?;
        (!line.starts_with(' ')).then(|| line.split_whitespace().next())?
    });
    let mut commands: Vec<&str> = names_of_commands.collect();
    commands.retain(|name| *name != "help");
    let has_all = commands.contains(&"selftest") && commands.contains(&"man");
    assert!(has_all, "{commands:?}");
    let files = std::fs::read_dir(&pages).unwrap();
    assert_eq!(files.count(), commands.len() + 1);
    let of_subcommands = commands.iter().map(|name| format!("-{name}"));
    let mut options = 0;
    for name in std::iter::once(String::new()).chain(of_subcommands) {
        let page = pages.join(format!("corticode-bridge{name}.1"));
        let page = std::fs::read_to_string(page).unwrap();
        let command = name.trim_start_matches('-');
        let mut arguments = vec![command, "--help"];
        arguments.retain(|argument| !argument.is_empty());
        for option in names(&stdout(&arguments)) {
            let in_roff = option.replace('-', "\\-");
            assert!(page.contains(&in_roff), "{command}: {option}: {page}");
            options += 1;
        }
    }
    assert!(options > 30, "{options}");
}

#[test]
fn a_folder_that_cannot_be_made_is_status_2() {
    let log = Bridge::start(&["man", "--folder", "/dev/null/man1"]).failure(2);
    assert!(log.contains("/dev/null/man1"), "{log}");
}
