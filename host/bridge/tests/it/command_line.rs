//! Errors on the command line, and the help text.

use crate::process::Bridge;

fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let (status, log) = Bridge::start(arguments).wait();
    (status.code(), log)
}

#[test]
fn wrong_usage_is_status_2_with_advice() {
    for (arguments, expected) in [
        (&["--port", "tcp:nowhere"][..], "tcp:127.0.0.1:5555"),
        (&["--port", "/dev/null", "--mains", "55"], "50 or 60"),
        (&["--port", "/dev/null", "--baud", "0"], "--baud"),
        (&["--port", "tcp:localhost:99999"], "0 to 65535"),
        (&["--port", "99999"], "write tcp:HOST:PORT"),
        (
            &["selftest", "--port", "localhost:5555"],
            "write tcp:HOST:PORT",
        ),
        (&["--port", "/tmp", "--sink", "ndjson"], "it is a folder"),
        (&["selftest", "--port", "/tmp"], "it is a folder"),
        (&["replay", "x", "--output", "tcp:h:99999"], "0 to 65535"),
        (&["replay", "x", "--output", "/tmp"], "write pty:PATH"),
        (&["replay", "x", "--output", "file:x"], "write pty:PATH"),
        (&["master", "--bind", "127.0.0.1:99999"], "0 to 65535"),
        (&["_prot:=/dev/null"], "known are port, baud"),
        (&["_port:=tcp:nowhere"], "tcp:127.0.0.1:5555"),
        (
            &["--port", "/dev/null", "--model", "/nowhere"],
            "model.toml",
        ),
        (
            &["--port", "/etc/passwd", "--sink", "ndjson"],
            "/dev/ttyACM0",
        ),
        (&["--port", "/dev/null", "--sink", "ndjson"], "/dev/ttyACM0"),
        (
            &["--port", "/dev/null", "--ros-master-uri", "nonsense"],
            "ROS_MASTER_URI",
        ),
    ] {
        let (code, log) = run(arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {log}");
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
    let mut bridge = Bridge::start(&["ports", "--udev-rule"]);
    let rule = std::io::read_to_string(bridge.stdout()).unwrap();
    assert!(bridge.wait().0.success());
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../packaging/60-corticode.rules"
    );
    assert_eq!(rule, std::fs::read_to_string(file).unwrap());
}

#[test]
fn help_names_every_option() {
    let mut bridge = Bridge::start(&["--help"]);
    let help = std::io::read_to_string(bridge.stdout()).unwrap();
    for option in [
        "--port",
        "--baud",
        "--ros-master-uri",
        "--sink",
        "--topic-prefix",
        "--model",
        "--stamp",
        "--mains",
        "--filler",
        "--low-latency",
        "--announce",
        "--streams",
        "--config",
        "selftest",
        "reset",
        "record",
        "replay",
        "convert",
        "ports",
        "doctor",
        "auto:SERIAL",
        "master",
        "completions",
        "man",
        "/diagnostics keeps its name",
    ] {
        assert!(help.contains(option), "{help}");
    }
    assert!(bridge.wait().0.success());
}
