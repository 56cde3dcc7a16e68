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
fn the_input_is_never_overwritten_and_another_file_only_with_force() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let bytes = EdfFile::with_all_electrodes(2).bytes();
    fs::write(at("in.edf"), &bytes).expect("writable");
    fs::write(at("out"), b"mine").expect("writable");
    for (name, more, reason) in
        [("in.edf", &["--force"][..], "is the input"), ("out", &[], "--force")]
    {
        let refused = play(&at("in.edf"), &at(name), more);
        assert_eq!(refused.status, Some(2), "{refused:?}");
        assert!(refused.log.contains(reason), "{refused:?}");
    }
    let read = |name: &str| fs::read(at(name)).expect("a file");
    assert!(read("in.edf") == bytes && read("out") == b"mine");

    for (name, more) in [("out", &["--force"][..]), ("new", &[])] {
        let written = play(&at("in.edf"), &at(name), more);
        assert_eq!(written.status, Some(0), "{written:?}");
    }
    assert!(read("new").len() > 1000 && read("out") == read("new"));
}

/// Starts an endless run that writes to `path`, sends `signal` to the process after it has written
/// some frames, and waits until it exits.
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
    assert!(refused.log.contains("no link to a pseudoterminal"), "{refused:?}");
    assert_eq!(fs::read(at("link")).expect("the data"), b"mine");

    // A link to a terminal, which a killed run can leave behind, is replaced.
    fs::remove_file(at("link")).expect("a link");
    symlink("/dev/pts/4711", at("link")).expect("a link");
    assert_eq!(run(&board).status, Some(0));
}

#[test]
fn an_output_that_cannot_be_is_wrong_usage_and_a_full_disk_has_failed() {
    for (output, allowed) in [
        ("tcp:localhost:99999", "a port of 0 to 65535; write tcp:127.0.0.1:5555"),
        ("tcp::5555", "write tcp:127.0.0.1:5555"),
        ("tcp:5555", "write tcp:127.0.0.1:5555"),
        ("99999", "write pty:PATH, tcp:HOST:PORT or file:PATH"),
        ("udp:1.2.3.4:5", "write pty:PATH, tcp:HOST:PORT or file:PATH"),
        ("pty:", "write pty:PATH"),
        ("ndjson:", "ndjson:PATH for lines of JSON"),
        ("file:/tmp", "/tmp is a folder; write the name of a file in it"),
        ("pty:/tmp", "/tmp exists and is no link to a pseudoterminal"),
        ("file:/no/such/folder/codes.bin", "/no/such/folder"),
        ("pty:/no/such/folder/board", "/no/such/folder"),
    ] {
        let refused = run(&["run", "-q", "--input=synthetic", "--output", output]);
        assert_eq!(refused.status, Some(2), "{refused:?}");
        assert!(refused.log.contains(allowed), "{refused:?}");
    }
    let full = "--output=file:/dev/full";
    let failed = run(&["run", "-q", "--input=synthetic", "--duration=1", full]);
    assert_eq!(failed.status, Some(1), "{failed:?}");
}
