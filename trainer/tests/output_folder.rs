//! The folder of `--out`: an artifact in it is replaced only on request.
#![forbid(unsafe_code)]

use std::fs;
use std::process::Command;

#[test]
fn an_artifact_is_refused_before_the_training_and_not_touched() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let model = folder.path().join("model.toml");
    fs::write(&model, "mine").expect("writable");
    let train = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
        command
            .args(["train", "--data=/nowhere", "--train=R03", "--test=R04"])
            .args(["--mains=50", "--out"])
            .arg(folder.path())
            .args(more);
        let output = command.output().expect("the program starts");
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let log = train(&[]);
    assert!(log.contains("replace it with --force"), "{log}");
    assert_eq!(fs::read(&model).expect("the file"), b"mine");
    // With --force the recordings are looked for.
    let log = train(&["--force"]);
    assert!(log.contains("/nowhere"), "{log}");
}
