//! The file of `--output file:PATH` is never the input, is replaced only on request, and is whole
//! or absent.

use std::{fs, os::unix::fs::symlink, path::Path};

use rustix::process::{Pid, Signal, kill_process};

use crate::edf_file::EdfFile;
use crate::program::{Finished, eventually, frames, program, run, wait};

fn play(input: &Path, output: &Path, more: &[&str]) -> Finished {
    let input = format!("--input={}", input.display());
    let output = format!("--output=file:{}", output.display());
    run(&[&["run", "-q", &input, &output], more].concat())
}

#[test]
fn the_input_is_not_overwritten_under_any_of_its_names() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let bytes = EdfFile::with_all_electrodes(2).bytes();
    fs::write(at("in.edf"), &bytes).expect("writable");
    symlink(at("in.edf"), at("symbolic.edf")).expect("a link");
    fs::hard_link(at("in.edf"), at("hard.edf")).expect("a link");
    fs::create_dir(at("folder")).expect("a folder");
    for name in ["in.edf", "symbolic.edf", "hard.edf", "folder/../in.edf"] {
        for more in [&[][..], &["--force"]] {
            let refused = play(&at("in.edf"), &at(name), more);
            assert_eq!(refused.status, Some(2), "{name}: {refused:?}");
            assert!(refused.log.contains("is the input"), "{refused:?}");
            let left = fs::read(at("in.edf")).expect("the recording");
            assert!(left == bytes, "{name}: the recording has changed");
        }
    }
}

#[test]
fn another_file_is_replaced_only_with_force() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("in.edf"), EdfFile::with_all_electrodes(2).bytes()).expect("writable");
    fs::write(at("out"), b"mine").expect("writable");
    let refused = play(&at("in.edf"), &at("out"), &[]);
    assert_eq!(refused.status, Some(2), "{refused:?}");
    assert!(refused.log.contains("--force"), "{refused:?}");
    assert_eq!(fs::read(at("out")).expect("a file"), b"mine");

    let replaced = play(&at("in.edf"), &at("out"), &["--force"]);
    assert_eq!(replaced.status, Some(0), "{replaced:?}");
    let new = play(&at("in.edf"), &at("new"), &[]);
    assert_eq!(new.status, Some(0), "{new:?}");
    let [replaced, new] = ["out", "new"].map(|name| fs::read(at(name)).expect("a file"));
    assert!(new.len() > 1000 && replaced == new);
}

/// Starts an endless run into `path`, sends it a signal after it has written some frames, and waits
/// for its end.
fn interrupt(path: &Path, signal: Signal) -> Finished {
    let output = format!("--output=file:{}", path.display());
    let child = program(&["run", "-q", "--input=synthetic", &output]);
    let child = { child }.spawn().expect("the program starts");
    let folder = path.parent().expect("a folder");
    eventually(|| {
        let files = fs::read_dir(folder).expect("a folder").flatten();
        let mut lengths = files.filter_map(|file| Some(file.metadata().ok()?.len()));
        lengths.any(|length| length > 10_000).then_some(())
    });
    kill_process(Pid::from_child(&child), signal).expect("it runs");
    wait(child)
}

#[test]
fn a_killed_run_leaves_no_half_file_under_the_name_and_an_interrupted_one_a_whole_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let killed = folder.path().join("killed");
    assert_eq!(interrupt(&killed, Signal::KILL).status, None);
    assert!(!killed.exists(), "half a file is under the name");

    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("interrupted");
    let finished = interrupt(&path, Signal::INT);
    assert_eq!(finished.status, Some(0), "{finished:?}");
    let bytes = fs::read(&path).expect("the file");
    let frames = frames(&bytes, |_| Some(())).len();
    assert!(frames > 50, "{frames} frames");
    assert_eq!(bytes.last(), Some(&0), "the last frame is whole");
}

#[test]
fn a_link_of_the_user_is_not_replaced_by_the_link_to_a_terminal() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("data"), b"mine").expect("writable");
    symlink(at("data"), at("link")).expect("a link");
    let output = format!("--output=pty:{}", at("link").display());
    let board = ["run", "-q", "--input=synthetic", "--duration=0.1", &output];
    let refused = run(&board);
    assert_eq!(refused.status, Some(2), "{refused:?}");
    assert!(
        refused.log.contains("no link to a pseudoterminal"),
        "{refused:?}"
    );
    assert_eq!(fs::read(at("link")).expect("the data"), b"mine");

    // A link to a terminal, which a killed run can leave behind, is replaced.
    fs::remove_file(at("link")).expect("a link");
    symlink("/dev/pts/4711", at("link")).expect("a link");
    assert_eq!(run(&board).status, Some(0));
}

#[test]
fn an_output_that_cannot_be_is_wrong_usage_with_what_is_allowed() {
    for (output, allowed) in [
        (
            "tcp:localhost:99999",
            "a port of 0 to 65535; write tcp:127.0.0.1:5555",
        ),
        ("tcp::5555", "write tcp:127.0.0.1:5555"),
        ("tcp:5555", "write tcp:127.0.0.1:5555"),
        ("99999", "write pty:PATH, tcp:HOST:PORT or file:PATH"),
        (
            "udp:1.2.3.4:5",
            "write pty:PATH, tcp:HOST:PORT or file:PATH",
        ),
        ("pty:", "write pty:PATH"),
        ("ndjson:", "ndjson:PATH for lines of JSON"),
        (
            "file:/tmp",
            "/tmp is a folder; write the name of a file in it",
        ),
        ("pty:/tmp", "/tmp exists and is no link to a pseudoterminal"),
    ] {
        let refused = run(&["run", "-q", "--input=synthetic", "--output", output]);
        assert_eq!(refused.status, Some(2), "{refused:?}");
        assert!(refused.log.contains(allowed), "{refused:?}");
    }
}

#[test]
fn an_output_that_cannot_be_created_is_wrong_usage_and_one_that_cannot_be_written_has_failed() {
    for (output, status) in [
        ("file:/no/such/folder/codes.bin", 2),
        ("pty:/no/such/folder/board", 2),
        ("file:/dev/full", 1),
    ] {
        let options = ["run", "-q", "--input=synthetic", "--duration=1"];
        let ended = run(&[&options[..], &["--output", output]].concat());
        assert_eq!(ended.status, Some(status), "{output}: {ended:?}");
    }
}
