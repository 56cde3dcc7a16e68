//! Tests of `trainer train`.

use super::{Folder, SMALL, assert_has};
use rustix::process::{Pid, Signal, kill_process};
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

#[test]
fn ctrl_c_leaves_a_checkpoint_with_which_the_training_goes_on() {
    let folder = Folder::with_runs(1, 40);
    let train = format!(
        "train {SMALL} --mode=shortcut --train=run1.gdf --out=model --checkpoint=run/state"
    );
    let mut command = folder.command(&format!("{train} --epochs=100000"));
    let child = command.stderr(Stdio::piped()).spawn();
    let child = child.expect("the program starts");
    let start = Instant::now();
    while !folder.path("run/state").exists() {
        assert!(start.elapsed() < Duration::from_mins(2), "no checkpoint");
        sleep(Duration::from_millis(20));
    }
    let id = i32::try_from(child.id()).expect("a process id");
    kill_process(Pid::from_raw(id).expect("a process"), Signal::INT).expect("it runs");
    let output = child.wait_with_output().expect("it ends");
    let log = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{log}");
    assert!(log.contains("--resume goes on"), "{log}");
    assert!(!folder.path("model/model.toml").exists());
    // Request fewer epochs than the checkpoint was started with.
    let log = folder.fail(&format!("{train} --epochs=2 --resume"), 2);
    assert!(log.contains("of 100000 epochs"), "{log}");
}

#[test]
fn an_artifact_is_refused_before_the_training_and_not_touched() {
    let folder = Folder::new();
    folder.write("model.toml", "mine");
    let train = "train --data=/nowhere --train=R03 --test=R04 --mains=50 --out=.";
    let log = folder.fail(train, 2);
    assert!(log.contains("replace it with --force"), "{log}");
    assert_eq!(folder.read("model.toml"), "mine");
    // With --force, the artifact is no obstacle, so the program goes on to look for the recordings.
    let log = folder.fail(&format!("{train} --force"), 1);
    assert!(log.contains("/nowhere"), "{log}");
}

#[test]
fn recordings_that_cannot_be_used_are_usage_errors() {
    let folder = Folder::with_runs(1, 20);
    for (options, words) in [
        ("--train=run1 --mains=55", "50 or 60"),
        ("--mains=50 --train=x*.edf", "no recording matches x*.edf"),
        ("--mains=50 --train=run7", "run1.gdf"),
        ("--mains=50 --train=run1 --test=run1.gdf", "run1.gdf"),
    ] {
        let shape = "--montage=cyton-8.toml --mode=pca --numbers=16";
        let log = folder.fail(&format!("train {shape} --out=model {options}"), 2);
        assert!(log.contains(words), "{options}: {log}");
    }
    assert!(!folder.path("model").exists());
}

#[test]
fn a_model_of_all_recordings_in_a_folder_has_no_test_figures() {
    let folder = Folder::with_runs(2, 20);
    assert_eq!(folder.train("pca", "--train=."), "");
    let card = folder.read("model/model.toml");
    // The card states that training omits each recording's start, in which the filters settle.
    assert_has(&card, &["run1.gdf", "run2.gdf", "in which the filters settle"]);
    assert!(!card.contains("[training.mse]"), "{card}");
}

#[test]
fn shapes_that_do_not_fit_are_refused_before_recordings_are_read() {
    let folder = Folder::new();
    let train = "train --data=/nowhere --train=R1 --test=R2 --mains=50 --out=/nowhere/model";
    for (options, expected) in [
        ("--mode=pca --numbers=132", "at most 128"),
        ("--mode=shortcut", "choose network.padding"),
        ("--mode=pca --hop=5", "4, 8 or 16"),
        ("--mode=pca --rate=300", "250, 256, 500"),
        ("--mode=paper", "use paper-code-only"),
    ] {
        let log = folder.fail(&format!("{train} --montage=cyton-8.toml {options}"), 2);
        assert!(log.contains(expected), "{options}: {log}");
    }
}
