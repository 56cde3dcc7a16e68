//! Tests of `trainer evaluate`, and of the option `--report` of `evaluate` and `train`.

use super::files::{Values, assert_near, elements, mean, points};
use super::{Folder, LABELS, SMALL, assert_has};
use std::fs;

#[test]
fn any_recording_is_evaluated_beside_pca_and_the_pictures_have_the_figures() {
    let folder = Folder::with_runs(2, 30);
    let train = "--train=run1 --test=run2 --epochs=1 --code-format=int8-exponent";
    let trained = folder.train("shortcut", train);
    fs::remove_file(folder.path("run1.gdf")).expect("the training file");
    // Without `--test`, the training card's test recordings are used. They yield the same figures
    // as the training, and figures for classifiers.
    let again = folder.succeed("evaluate --artifact=model --data=.");
    assert!(again.starts_with(&trained), "{again}");
    assert_has(&again[trained.len()..], &["for classifiers", "\npca "]);
    // Evaluate on a recording that lacks the last two electrodes and is named by its path.
    folder.write_recording("other.gdf", &LABELS[..6], 30, 9);
    let evaluate = "evaluate --artifact=model --test=other.gdf --json --report=report";
    let json = folder.json(evaluate);
    let figure = |name: &str| json[name].as_f64().expect("a number");
    // A code has 16 numbers of 8 bits, and an exponent of 8 bits.
    assert_eq!(json["bits_per_window"], 136);
    assert_eq!(json["real_electrodes"], 6);
    assert_eq!(json["recordings"][0], "other.gdf");
    for name in ["mse_float", "mse_int8", "mse_pca", "mse_pca_int8"] {
        assert!((1e-9..2.0).contains(&figure(name)), "{name}: {json}");
    }

    let electrodes = Values::read(&folder.path("report/electrodes.csv"));
    assert_eq!(electrodes.column("electrode"), LABELS);
    for name in ["mse_float", "mse_int8"] {
        assert_near(mean(&electrodes.numbers(name)), figure(name), 1e-9);
    }
    let origins: Vec<&str> = electrodes.column("origin");
    assert_eq!(origins[..6], ["measured"; 6]);
    assert_eq!(origins[6..], ["interpolated"; 2]);
    // One circle is the head. Each electrode has two circles; the inner one is hollow if the
    // electrode is interpolated.
    let map = elements(&folder.path("report/electrodes.svg"), "circle");
    assert_eq!(map.len(), 1 + 2 * LABELS.len());
    let is_hollow = |circle: &&String| circle.contains("r=3;") && circle.contains("fill=none;");
    assert_eq!(map.iter().filter(is_hollow).count(), 2);

    let page = folder.read("report/index.html");
    for name in ["electrodes.svg", "electrodes.csv"] {
        assert!(page.contains(&format!("=\"{name}\"")), "{page}");
    }
    let error = format!("{:.5}", figure("mse_int8"));
    assert!(page.contains(&error), "{page}");

    // A report is replaced only on request.
    let log = folder.fail(evaluate, 2);
    assert!(log.contains("report/index.html exists already"), "{log}");
    folder.succeed(&format!("{evaluate} --force"));
}

#[test]
fn a_model_without_pca_is_evaluated_alone_and_a_training_file_is_named() {
    let folder = Folder::with_runs(1, 30);
    folder.train("shortcut", "--train=run1.gdf --epochs=1");
    let log = folder.fail("evaluate --artifact=model", 2);
    assert!(log.contains("--test"), "{log}");
    fs::remove_file(folder.path("model/pca.safetensors")).expect("the stored PCA");
    let [table, log] = folder.run("evaluate --artifact=model --test=run1.gdf", 0);
    assert_has(&log, &["trained on run1.gdf", "no pca.safetensors"]);
    assert_has(&table, &["autoencoder"]);
    assert!(!table.contains("PCA"), "{table}");
}

#[test]
fn learning_curves_have_all_epochs_also_those_before_a_checkpoint() {
    let folder = Folder::with_runs(2, 30);
    let train = "--train=run1 --test=run2 --checkpoint=state --learning-rate=1e-2 --report=report";
    folder.train("shortcut", &format!("{train} --epochs=1"));
    let learning = || Values::read(&folder.path("report/learning.csv"));
    let first = learning();
    assert_eq!(first.column("epoch"), ["0", "1"]);
    // Add epochs to a finished training run.
    folder.train("shortcut", &format!("{train} --epochs=3 --resume --force"));
    let resumed = learning();
    assert_eq!(resumed.column("epoch"), ["0", "1", "2", "3"]);
    assert_eq!(resumed.rows[..2], first.rows);
    // At epoch 0 the shortcut equals PCA.
    let validation = resumed.numbers("validation_mse");
    let pca = resumed.numbers("validation_mse_pca");
    assert_near(validation[0], pca[0], 1e-5);
    assert_eq!(resumed.column("training_loss")[0], "");
    let best = (0..validation.len()).min_by(|a, b| validation[*a].total_cmp(&validation[*b]));
    let best = best.expect("epochs");
    let card = folder.read("model/model.toml");
    for line in [format!("best_epoch = {best}"), "epochs = 3".to_owned()] {
        assert!(card.lines().any(|found| found == line), "{line}: {card}");
    }
    let picture = folder.path("report/learning.svg");
    // Blue lines are validation errors, and orange lines are errors of PCA. The second line of each
    // colour is its entry in the legend, which has two points.
    assert_eq!(points(&picture, "#2B6CB0"), [4, 2]);
    assert_eq!(points(&picture, "#DD6B20"), [2, 2]);
    let page = folder.read("report/index.html");
    for name in ["learning.svg", "electrodes.svg"] {
        assert!(page.contains(&format!("src=\"{name}\"")), "{page}");
    }
}

#[test]
fn folders_that_cannot_be_written_are_found_before_anything_is_read() {
    let folder = Folder::new();
    // This file is not a recording, and there is no model: reading either would fail with another
    // message.
    folder.write("run1.gdf", "nothing");
    folder.write("file", "");
    let train = format!("train {SMALL} --train=run1 --out=model");
    let evaluate = "evaluate --artifact=model --test=run1.gdf";
    for (command, option, named) in [
        (train.as_str(), "--report=file", "file"),
        (&train, "--report=file/report", "file/report"),
        (&train, "--checkpoint=file/state", "file"),
        (evaluate, "--report=file", "file"),
        (evaluate, "--report=file/report", "file/report"),
        (&train.replace("=model", "=file/model"), "", "file/model"),
    ] {
        let log = folder.fail(&format!("{command} {option}"), 1);
        let expected = format!("{named} cannot be written; name another folder");
        assert!(log.contains(&expected), "{command} {option}: {log}");
    }
    // In mode pca there are no epochs, so a report would have nothing to show.
    let log = folder.fail(&format!("{train} --mode=pca --report=report"), 2);
    assert!(log.contains("--report has nothing to show"), "{log}");
    assert!(!folder.path("report").exists());
}
