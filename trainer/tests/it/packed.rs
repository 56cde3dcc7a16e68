//! Tests of `trainer packed`.

use super::files::Values;
use super::{Folder, assert_has};
use artifact::{Artifact, Mode};

/// Command that adds a packed model to the artifact `model`.
const JOIN: &str = "packed --artifact=model --mains=50 --train=run1";
/// Command that makes a packed model without a network, in the new folder `alone`.
const ALONE: &str = "packed --montage=cyton-8.toml --out=alone --mains=50 --train=run1";

/// Returns a folder with two runs, and a PCA model trained on the first run.
fn prepared() -> Folder {
    let folder = Folder::with_runs(2, 60);
    folder.train("pca", "--train=run1");
    folder
}

#[test]
fn a_packed_model_joins_the_artifact_and_is_evaluated_beside_pca() {
    let folder = prepared();
    let before = folder.read("model/model.toml");
    let table = folder.succeed(&format!("{JOIN} --test=run2"));
    // Two tables of 16 rates, each with a title and two more lines, and a blank line between them.
    assert_eq!(table.lines().count(), 2 * 19 + 1, "{table}");
    assert_eq!(folder.read("model/model.toml"), before);
    let toml = folder.read("model/packed.toml");
    // A block of eight electrodes and eight steps has 64 values and cannot have more coefficients,
    // so the default is reduced to 64.
    assert_has(&toml, &["coefficients = 64", "run2.gdf"]);

    let json = folder.json("evaluate --artifact=model --test=run2 --json --report=report");
    let rates = json["packed"].as_array().expect("the rates");
    assert_eq!(rates.len(), 16);
    let figure = |rate: usize, name: &str| rates[rate][name].as_f64().expect("a number");
    for rate in 1..13 {
        let bits = figure(rate, "bits_per_hop");
        assert!(bits <= figure(rate - 1, "bits_per_hop"), "{rate}");
        assert!(figure(rate, "mse") > figure(rate - 1, "mse"), "{rate}");
    }
    // 64 coefficients represent a block's 64 values fully; only quantisation error remains.
    assert!(figure(0, "mse") < 0.01, "{json}");
    assert!(figure(4, "mse_smoothed") < figure(4, "mse"), "{json}");
    // At equal error, prediction saves bits compared with the KLT, which does not predict.
    let klt = &json["packed_without_prediction"];
    assert_eq!(klt.as_array().map(Vec::len), Some(16));
    for rate in [2, 4, 6] {
        let peer = |name: &str| klt[rate][name].as_f64().expect("a number");
        assert!(figure(rate, "bits_per_hop") < peer("bits"), "{rate}: {json}");
        let ratio = peer("mse") / figure(rate, "mse");
        assert!((ratio - 1.0).abs() < 0.3, "{rate}: {json}");
    }
    let values = Values::read(&folder.path("report/packed.csv"));
    let models = values.column("model").into_iter();
    assert_eq!(models.filter(|model| *model == "packed").count(), 16);
    assert!(folder.path("report/packed.svg").exists());
}

#[test]
fn a_packed_model_alone_needs_no_network() {
    let folder = Folder::with_runs(2, 60);
    folder.succeed(&format!("{ALONE} --test=run2 --dataset=synthetic"));
    let artifact = Artifact::read(&folder.path("alone")).expect("a model");
    assert_eq!(artifact.description.mode, Mode::Packed);
    let card = &artifact.description.training;
    assert_eq!((card.dataset.as_str(), card.mains_hz), ("synthetic", 50));
    assert_eq!((card.real_electrodes, card.interpolated_electrodes), (8, 0));
    let trained = artifact.packed.expect("a packed model").description.training;
    assert_eq!(trained.test_files, ["run2.gdf"]);

    let json = folder.json("evaluate --artifact=alone --json --report=report");
    assert_eq!(json["mode"], "packed");
    assert_eq!(json.get("mse_float"), None);
    let rates = json["packed"].as_array().expect("the rates");
    for (figures, rate) in trained.figures.iter().zip(rates) {
        let mse = rate["mse"].as_f64().expect("a number");
        assert!((mse - figures.mse).abs() < 1e-6, "{figures:?} {rate}");
    }
    let values = Values::read(&folder.path("report/packed.csv"));
    assert_eq!(values.column("model").len(), 32);
    let table = folder.succeed("evaluate --artifact=alone");
    assert_has(&table, &["no network; 8 of 8 electrodes"]);
    assert!(!table.contains("PCA"), "{table}");

    let log = folder.fail(ALONE, 2);
    assert!(log.contains("--force"), "{log}");
    // A block with half the steps has 32 values and cannot have more coefficients, so the default
    // is reduced to 32.
    folder.succeed(&format!("{ALONE} --force --hop=4"));
    let toml = folder.read("alone/packed.toml");
    assert!(toml.contains("coefficients = 32"), "{toml}");
}

#[test]
fn a_wanted_error_chooses_the_coarsest_rate_that_has_it() {
    let folder = prepared();
    let table = folder.succeed(&format!("{JOIN} --test=run2 --target-mse=0.05"));
    let error = |line: &str| -> f64 {
        let field = line.split_whitespace().nth(4).expect("an error");
        field.parse().expect("a number")
    };
    let errors: Vec<f64> = table.lines().skip(3).take(16).map(error).collect();
    let expected = errors.iter().rposition(|error| *error <= 0.05);
    let expected = format!("\nrate = {}\n", expected.expect("a rate"));
    let toml = folder.read("model/packed.toml");
    assert!(toml.contains(&expected), "{expected}: {toml}");
    let log = folder.fail(&format!("{JOIN} --force --target-mse=0.0000001"), 2);
    assert_has(&log, &["no rate has", "--coefficients"]);
}

#[test]
fn what_cannot_be_is_refused_with_status_2_before_recordings_are_read() {
    let folder = prepared();
    for (command, arguments, words) in [
        (JOIN, "--coefficients=72", "multiple of 16, and at most 64"),
        (JOIN, "--coefficients=24", "cannot have 24 coefficients"),
        (JOIN, "--test=run1.gdf", "run1.gdf"),
        (JOIN, "--train=run7", "run7"),
        // Options of a new model and an existing artifact exclude each other.
        (JOIN, "--out=new", "cannot be used with"),
        (JOIN, "--hop=4", "cannot be used with"),
        (JOIN, "--citation=none", "cannot be used with"),
        (ALONE, "--artifact=model", "cannot be used with"),
        (ALONE, "--hop=7", "window.hop is 7"),
    ] {
        let log = folder.fail(&format!("{command} {arguments}"), 2);
        assert!(log.contains(words), "{log}");
    }
    folder.succeed(JOIN);
    let log = folder.fail(JOIN, 2);
    assert!(log.contains("--force"), "{log}");
    folder.succeed(&format!("{JOIN} --force --coefficients=16"));
}
