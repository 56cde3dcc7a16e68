//! `trainer packed`.

use artifact::{Artifact, Mode};
use serde_json::Value as Json;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::values::Values;
use crate::{fail, succeed, trainer, write_runs};

/// Returns `trainer packed` on the artifact `model` of a folder with runs.
fn packed(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
    command
        .args(["packed", "--artifact=model", "--mains=50", "--train=run1"])
        .current_dir(folder);
    command
}

/// Writes two runs, and a model of PCA on the first.
fn prepare(folder: &Path) {
    write_runs(folder, 2, 60);
    let train = ["--train=run1", "--out=model"];
    succeed(trainer("train", "pca", folder).args(train));
}

#[test]
fn a_packed_model_joins_the_artifact_and_is_evaluated_beside_pca() {
    let folder = tempfile::tempdir().expect("a folder");
    prepare(folder.path());
    let before = fs::read(folder.path().join("model/model.toml")).expect("the description");
    let table = succeed(packed(folder.path()).arg("--test=run2"));
    // Two tables of 16 rates, each with two lines above and a title, and a blank line between them.
    assert_eq!(table.lines().count(), 2 * 19 + 1, "{table}");
    let path = folder.path().join("model/model.toml");
    assert_eq!(fs::read(path).expect("the description"), before);
    let toml = fs::read_to_string(folder.path().join("model/packed.toml")).expect("packed.toml");
    // Eight electrodes and hops of eight steps have 64 values.
    assert!(
        toml.contains("coefficients = 64") && toml.contains("run2.gdf"),
        "{toml}"
    );

    let mut evaluate = Command::new(env!("CARGO_BIN_EXE_trainer"));
    let arguments = [
        "evaluate",
        "--artifact=model",
        "--test=run2",
        "--json",
        "--report=report",
    ];
    let printed = succeed(evaluate.args(arguments).current_dir(&folder));
    let json: Json = serde_json::from_str(&printed).expect("JSON");
    let rates = json["packed"].as_array().expect("the rates");
    assert_eq!(rates.len(), 16);
    let figure = |rate: usize, name: &str| rates[rate][name].as_f64().expect("a number");
    for rate in 1..13 {
        assert!(
            figure(rate, "bits_per_hop") <= figure(rate - 1, "bits_per_hop"),
            "{rate}"
        );
        assert!(figure(rate, "mse") > figure(rate - 1, "mse"), "{rate}");
    }
    // All 64 coefficients represent the block; what is left is the quantiser.
    assert!(figure(0, "mse") < 0.01, "{json}");
    assert!(figure(4, "mse_smoothed") < figure(4, "mse"), "{json}");
    for name in ["band_correlation_8_13", "band_correlation_13_30"] {
        assert!(
            figure(0, name) > 0.97 && figure(12, name) < figure(0, name),
            "{json}"
        );
    }
    // The prediction saves bits at the same error, more than the trellis or the contexts do.
    let klt = json["packed_without_prediction"]
        .as_array()
        .expect("the peer");
    assert_eq!(klt.len(), 16);
    for rate in [2, 4, 6] {
        let peer = |name: &str| klt[rate][name].as_f64().expect("a number");
        assert!(
            figure(rate, "bits_per_hop") < peer("bits"),
            "{rate}: {json}"
        );
        assert!(
            (peer("mse") / figure(rate, "mse") - 1.0).abs() < 0.3,
            "{rate}: {json}"
        );
    }
    let values = Values::read(&folder.path().join("report/packed.csv"));
    assert_eq!(
        values
            .column("model")
            .iter()
            .filter(|model| **model == "packed")
            .count(),
        16
    );
    assert!(folder.path().join("report/packed.svg").exists());
}

/// Returns `trainer packed` for a new model without a network, in the folder `alone`.
fn packed_alone(folder: &Path) -> Command {
    let montage = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../files/montages/cyton-8.toml"
    );
    let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
    command
        .args(["packed", "--montage", montage, "--out=alone", "--mains=50"])
        .arg("--train=run1")
        .current_dir(folder);
    command
}

#[test]
fn a_packed_model_alone_needs_no_network() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 2, 60);
    succeed(packed_alone(folder.path()).args(["--test=run2", "--dataset=synthetic"]));
    let artifact = Artifact::read(&folder.path().join("alone")).expect("a model");
    assert_eq!(artifact.description.mode, Mode::Packed);
    let card = &artifact.description.training;
    assert_eq!((card.dataset.as_str(), card.mains_hz), ("synthetic", 50));
    assert_eq!((card.real_electrodes, card.interpolated_electrodes), (8, 0));
    let trained = &artifact
        .packed
        .expect("a packed model")
        .description
        .training;
    assert_eq!(trained.test_files, ["run2.gdf"]);

    let evaluate = |arguments: &[&str]| {
        let mut evaluate = Command::new(env!("CARGO_BIN_EXE_trainer"));
        evaluate.args(["evaluate", "--artifact=alone"]);
        succeed(evaluate.args(arguments).current_dir(&folder))
    };
    let json: Json = serde_json::from_str(&evaluate(&["--json", "--report=report"])).expect("JSON");
    assert_eq!(json["mode"], "packed");
    assert_eq!(json.get("mse_float"), None);
    let rates = json["packed"].as_array().expect("the rates");
    for (figures, rate) in trained.figures.iter().zip(rates) {
        let mse = rate["mse"].as_f64().expect("a number");
        assert!((mse - figures.mse).abs() < 1e-6, "{figures:?} {rate}");
    }
    let values = Values::read(&folder.path().join("report/packed.csv"));
    assert_eq!(values.column("model").len(), 32);
    let table = evaluate(&[]);
    assert!(
        table.contains("no network; 8 of 8 electrodes") && !table.contains("PCA"),
        "{table}"
    );

    let log = fail(&mut packed_alone(folder.path()), 2);
    assert!(log.contains("--force"), "{log}");
    // Half the steps of a block have half the values.
    let shorter = ["--force", "--hop=4"];
    succeed(packed_alone(folder.path()).args(shorter));
    let toml = fs::read_to_string(folder.path().join("alone/packed.toml")).expect("packed.toml");
    assert!(toml.contains("coefficients = 32"), "{toml}");
}

#[test]
fn a_new_model_and_an_artifact_exclude_each_other() {
    let folder = tempfile::tempdir().expect("a folder");
    prepare(folder.path());
    for (arguments, words) in [
        (vec!["--artifact=model"], "cannot be used with"),
        (vec!["--hop=7"], "window.hop is 7"),
    ] {
        let log = fail(packed_alone(folder.path()).args(arguments), 2);
        assert!(log.contains(words), "{log}");
    }
    for argument in ["--out=new", "--hop=4", "--citation=none"] {
        let log = fail(packed(folder.path()).arg(argument), 2);
        assert!(log.contains("cannot be used with"), "{log}");
    }
}

#[test]
fn a_wanted_error_chooses_the_coarsest_rate_that_has_it() {
    let folder = tempfile::tempdir().expect("a folder");
    prepare(folder.path());
    let table = succeed(packed(folder.path()).args(["--test=run2", "--target-mse=0.05"]));
    let errors: Vec<f64> = table
        .lines()
        .skip(3)
        .take(16)
        .map(|line| {
            line.split_whitespace()
                .nth(4)
                .expect("an error")
                .parse()
                .expect("a number")
        })
        .collect();
    let expected = errors
        .iter()
        .rposition(|error| *error <= 0.05)
        .expect("a rate");
    let toml = fs::read_to_string(folder.path().join("model/packed.toml")).expect("packed.toml");
    assert!(
        toml.contains(&format!("\nrate = {expected}\n")),
        "{expected}: {toml}"
    );
    let log = fail(
        packed(folder.path()).args(["--force", "--target-mse=0.0000001"]),
        2,
    );
    assert!(
        log.contains("no rate has") && log.contains("--coefficients"),
        "{log}"
    );
}

#[test]
fn what_cannot_be_is_refused_with_status_2_before_recordings_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    prepare(folder.path());
    for (arguments, words) in [
        (vec!["--coefficients=72"], "multiple of 16, and at most 64"),
        (vec!["--coefficients=24"], "cannot have 24 coefficients"),
        (vec!["--test=run1.gdf"], "run1.gdf"),
        (vec!["--train=run7"], "run7"),
    ] {
        let log = fail(packed(folder.path()).args(arguments), 2);
        assert!(log.contains(words), "{log}");
    }
    succeed(&mut packed(folder.path()));
    let log = fail(&mut packed(folder.path()), 2);
    assert!(log.contains("--force"), "{log}");
    succeed(packed(folder.path()).args(["--force", "--coefficients=16"]));
}
