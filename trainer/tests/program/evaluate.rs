//! `trainer evaluate`.

use serde_json::Value as Json;
use std::fs;
use std::process::Command;

use crate::{LABELS, fail, succeed, trainer, write_recording, write_runs};

fn evaluate() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
    command.arg("evaluate");
    command
}

#[test]
fn any_recording_is_evaluated_beside_pca_without_the_training_files() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 2, 30);
    let train = ["--train=run1", "--test=run2", "--epochs=1", "--out=model"];
    let trained = succeed(trainer("train", "shortcut", folder.path()).args(train));
    fs::remove_file(folder.path().join("run1.gdf")).expect("the training file");
    // Those of the training card, whose figures are the same.
    let again = succeed(
        evaluate()
            .args(["--artifact=model", "--data=."])
            .current_dir(&folder),
    );
    assert_eq!(again, trained);
    // Another recording, by its path, with fewer electrodes.
    write_recording(&folder.path().join("other.gdf"), &LABELS[..6], 30, 9);
    let arguments = ["--artifact=model", "--test=other.gdf", "--json"];
    let printed = succeed(evaluate().args(arguments).current_dir(&folder));
    let json: Json = serde_json::from_str(&printed).expect("JSON");
    let figure = |name: &str| json[name].as_f64().expect("a number");
    assert_eq!(json["bits_per_window"], 128);
    assert_eq!(json["real_electrodes"], 6);
    assert_eq!(json["recordings"][0], "other.gdf");
    for [float, int8] in [["mse_float", "mse_int8"], ["mse_pca", "mse_pca_int8"]] {
        assert!(
            figure(float) > 0.0 && figure(int8) > 0.0 && figure(int8) < 2.0,
            "{json}"
        );
    }
    // Three sources in eight electrodes: codes of 16 numbers keep most of the power. Measured: 0.9 and more.
    for name in ["band_correlation_8_13", "band_correlation_13_30"] {
        for name in [name.to_owned(), format!("{name}_pca")] {
            assert!((0.7..1.0).contains(&figure(&name)), "{name}: {json}");
        }
    }
}

#[test]
fn a_model_without_pca_is_evaluated_alone_and_a_training_file_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 1, 30);
    let train = ["--train=run1.gdf", "--epochs=1", "--out=model"];
    succeed(trainer("train", "shortcut", folder.path()).args(train));
    let mut command = evaluate();
    command.arg("--artifact=model").current_dir(&folder);
    let log = fail(&mut command, 2);
    assert!(log.contains("--test"), "{log}");
    fs::remove_file(folder.path().join("model/pca.safetensors")).expect("the stored PCA");
    let output = command
        .arg("--test=run1.gdf")
        .output()
        .expect("the program starts");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(
        log.contains("trained on run1.gdf") && log.contains("no pca.safetensors"),
        "{log}"
    );
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(
        table.contains("autoencoder") && !table.contains("PCA"),
        "{table}"
    );
}
