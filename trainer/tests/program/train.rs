//! `trainer train`.

use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::{fail, log, succeed, trainer, write_runs};

#[test]
fn ctrl_c_leaves_a_checkpoint_with_which_the_training_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 1, 40);
    let train = || {
        let mut command = trainer("train", "shortcut", folder.path());
        command.args(["--train=run1.gdf", "--out=model", "--checkpoint=run/state"]);
        command
    };
    let mut command = train();
    let child = command
        .arg("--epochs=100000")
        .stderr(Stdio::piped())
        .spawn();
    let child = child.expect("the program starts");
    let start = Instant::now();
    while !folder.path().join("run/state").exists() {
        assert!(start.elapsed() < Duration::from_mins(2), "no checkpoint");
        sleep(Duration::from_millis(20));
    }
    let id = i32::try_from(child.id()).expect("a process id");
    kill_process(Pid::from_raw(id).expect("a process"), Signal::INT).expect("it runs");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130), "{}", log(&output));
    assert!(
        log(&output).contains("--resume goes on"),
        "{}",
        log(&output)
    );
    assert!(!folder.path().join("model/model.toml").exists());
    // Fewer epochs than the checkpoint was started with.
    let log = fail(train().args(["--epochs=2", "--resume"]), 2);
    assert!(log.contains("of 100000 epochs"), "{log}");
}

#[test]
fn epochs_can_be_added_to_a_finished_training() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 1, 30);
    let train = |more: &[&str]| {
        let mut command = trainer("train", "shortcut", folder.path());
        command
            .args(["--train=run1.gdf", "--out=model", "--checkpoint=state"])
            .args(more);
        command
    };
    succeed(&mut train(&["--epochs=1"]));
    succeed(&mut train(&["--epochs=3", "--resume", "--force"]));
    let card = fs::read_to_string(folder.path().join("model/model.toml")).expect("the card");
    assert!(card.contains("epochs = 3"), "{card}");
}

#[test]
fn folders_that_cannot_be_written_are_found_before_recordings_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    // No recording: reading it would fail with other words.
    fs::write(folder.path().join("run1.gdf"), "nothing").expect("writable");
    fs::write(folder.path().join("file"), "").expect("writable");
    for (out, checkpoint) in [("file/model", "state"), ("model", "file/state")] {
        let arguments = [
            "--train=run1.gdf".to_owned(),
            format!("--out={out}"),
            format!("--checkpoint={checkpoint}"),
        ];
        let log = fail(
            trainer("train", "shortcut", folder.path()).args(arguments),
            1,
        );
        assert!(
            log.contains("cannot be written; name another folder"),
            "{log}"
        );
    }
}

#[test]
fn other_mains_and_recordings_that_are_not_there_are_usage_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 1, 20);
    let train = |arguments: &[&str]| {
        let mut command = trainer("train", "pca", folder.path());
        command.arg("--out=model").args(arguments);
        fail(&mut command, 2)
    };
    let mut other_mains = Command::new(env!("CARGO_BIN_EXE_trainer"));
    other_mains.args(["train", "--train=run1", "--out=model", "--mains=55"]);
    assert!(fail(&mut other_mains, 2).contains("50 or 60"));
    assert!(train(&["--train=x*.edf"]).contains("no recording matches x*.edf"));
    assert!(train(&["--train=run7"]).contains("run1.gdf"));
    assert!(train(&["--train=run1", "--test=run1.gdf"]).contains("run1.gdf"));
    assert!(!folder.path().join("model").exists());
}

#[test]
fn a_model_of_all_recordings_in_a_folder_has_no_test_figures() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 2, 20);
    let printed =
        succeed(trainer("train", "pca", folder.path()).args(["--train=.", "--out=model"]));
    assert_eq!(printed, "");
    let card = fs::read_to_string(folder.path().join("model/model.toml")).expect("the card");
    assert!(
        card.contains("run1.gdf") && card.contains("run2.gdf"),
        "{card}"
    );
    assert!(!card.contains("[training.mse]"), "{card}");
    // The device's flag `settling` is set for as long.
    assert!(card.contains("in which the filters settle"), "{card}");
}
