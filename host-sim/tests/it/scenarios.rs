//! The command `host-sim scenario`.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use tempfile::TempDir;

/// Runs `host-sim scenario` with these arguments.
fn scenario(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let command = command.args(["scenario", "--quiet"]).args(arguments);
    command.output().expect("host-sim runs")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("UTF-8")
}

/// Rehearses a scenario whose file has this text, with further arguments.
fn rehearse(toml: &str, arguments: &[&str]) -> Output {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("scenario.toml");
    fs::write(&path, toml).expect("the file");
    let path = path.to_str().expect("UTF-8");
    scenario(&[&[path], arguments].concat())
}

#[test]
fn every_scenario_of_the_repository_but_the_soak_passes() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let files = fs::read_dir(folder).expect("the folder").map(|entry| {
        let path = entry.expect("a file").path();
        path.into_os_string().into_string().expect("UTF-8")
    });
    let mut files: Vec<String> = files.filter(|file| !file.ends_with("soak.toml")).collect();
    files.sort();
    assert!(files.len() > 10);
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let output = scenario(&files);
    println!("{}", text(&output.stdout));
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
    assert_eq!(text(&output.stdout).lines().count(), files.len());
}

const NOISY: &str = r#"
name = "a \"noisy\" line <&>"
duration_s = 8
streams = ["packed", "filtered", "events"]
trigger_every_s = 0.1

[noise]
bit_errors = 1e-4
frames_dropped = 0.1
"#;

#[test]
fn equal_files_yield_equal_bytes_and_another_seed_others() {
    let [once, again] = [0, 1].map(|_| rehearse(NOISY, &["--json"]).stdout);
    assert_eq!(once, again);
    let other = rehearse(&format!("seed = 2\n{NOISY}"), &["--json"]).stdout;
    assert_ne!(once, other);
}

#[test]
fn a_limit_that_is_exceeded_fails_with_the_figure_and_the_key_also_in_junit() {
    let folder = TempDir::new().expect("a folder");
    let junit = folder.path().join("junit.xml");
    let output = rehearse(NOISY, &["--junit", junit.to_str().expect("UTF-8")]);
    assert_eq!(output.status.code(), Some(1));
    let verdict = text(&output.stdout);
    for part in
        ["FAIL a \"noisy\" line <&>: 8 s", "exceeds limits.fillers", "exceeds limits.lost_events"]
    {
        assert!(verdict.contains(part), "{verdict}");
    }
    let xml = fs::read_to_string(junit).expect("the file");
    assert!(xml.contains("name=\"a &quot;noisy&quot; line &lt;&amp;&gt;\""), "{xml}");
    assert!(xml.contains("failures=\"1\"") && xml.contains("<failure message=\""), "{xml}");
}

#[test]
fn a_fault_that_does_not_take_place_is_refused_or_fails() {
    let silent = "name = \"silent\"\nduration_s = 5\nstreams = [\"packed\"]\n";
    for (fault, status, part) in [
        (
            "[[fault]]\nkind = \"stall\"\nat_s = 4\nfor_s = 2",
            2,
            "scenario.toml:4: this fault ends at 6 s",
        ),
        ("[[fault]]\nkind = \"commands\"\nat_s = 1", 2, "needs per_s"),
        ("converters = [\"dead@5s:chip0\"]", 2, "begins after the end at 5 s"),
        ("[clock]\nchanges = [{ at_s = 5, ppm = 1 }]", 2, "begins after the end at 5 s"),
        ("[noise]\nbit_errors = 1e-12", 1, "noise.bit_errors had no effect"),
        (
            "[[fault]]\nkind = \"lost-acks\"\nat_s = 2\nfor_s = 1",
            1,
            "the fault LostAcks at 2 s had no effect",
        ),
        ("[noise]\nbit_error = 1", 2, "line 5"),
        ("[noise]\nbit_errors = 2", 2, "write a rate from 0 to below 1"),
        ("[line]\nkind = \"serial\"", 2, "`usb`, `uart`, `tcp`"),
        ("announced = \"raw\"", 2, "add it to streams"),
    ] {
        let output = rehearse(&format!("{silent}{fault}"), &[]);
        let said = [text(&output.stdout), text(&output.stderr)].concat();
        assert_eq!(output.status.code(), Some(status), "{fault}: {said}");
        assert!(said.contains(part), "{fault}: {said}");
    }
}
