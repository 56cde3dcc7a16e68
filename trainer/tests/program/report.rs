//! `--report` of `trainer train` and `trainer evaluate`.

use serde_json::Value as Json;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::picture_file::{elements, points};
use crate::values::{Values, assert_near, mean};
use crate::{LABELS, fail, succeed, trainer, write_recording, write_runs};

fn evaluate(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
    command
        .args(["evaluate", "--artifact=model"])
        .args(arguments)
        .current_dir(folder);
    command
}

#[test]
fn pictures_of_an_evaluation_have_its_figures() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write_runs(folder, 1, 30);
    let train = [
        "--train=run1",
        "--epochs=1",
        "--out=model",
        "--code-format=int8-exponent",
    ];
    succeed(trainer("train", "shortcut", folder).args(train));
    // A recording without the last two electrodes.
    write_recording(&folder.join("other.gdf"), &LABELS[..6], 30, 9);
    let arguments = ["--test=other.gdf", "--json", "--report=report"];
    let printed = succeed(&mut evaluate(folder, &arguments));
    let json: Json = serde_json::from_str(&printed).expect("JSON");
    let figure = |name: &str| json[name].as_f64().expect("a number");

    let electrodes = Values::read(&folder.join("report/electrodes.csv"));
    assert_eq!(electrodes.column("electrode"), LABELS);
    for name in ["mse_float", "mse_int8"] {
        assert_near(mean(&electrodes.numbers(name)), figure(name), 1e-9);
    }
    let origins: Vec<&str> = electrodes.column("origin");
    assert_eq!(origins[..6], ["measured"; 6]);
    assert_eq!(origins[6..], ["interpolated"; 2]);
    // The head, and two circles for each electrode, of which the inner one is hollow where it is interpolated.
    let map = elements(&folder.join("report/electrodes.svg"), "circle");
    assert_eq!(map.len(), 1 + 2 * LABELS.len());
    let hollow = map
        .iter()
        .filter(|circle| circle.contains("r=3;") && circle.contains("fill=none;"));
    assert_eq!(hollow.count(), 2);

    let rate = Values::read(&folder.join("report/rate.csv"));
    let numbers = rate.rows.len() - 1;
    assert_eq!(rate.column("model")[..numbers], vec!["PCA"; numbers]);
    let bits = rate.numbers("bits_per_window");
    for (column, pca, model) in [
        ("mse_float", "mse_pca", "mse_float"),
        ("mse_int8", "mse_pca_int8", "mse_int8"),
    ] {
        let errors = rate.numbers(column);
        // f32 in another order of summation.
        assert_near(errors[numbers - 1], figure(pca), 1e-4);
        assert_near(errors[numbers], figure(model), 1e-12);
        assert!(errors[0] > errors[numbers - 1], "{errors:?}");
    }
    assert_near(bits[0], 16.0, 1e-12);
    assert_near(bits[numbers], figure("bits_per_window"), 1e-12);
    let picture = folder.join("report/rate.svg");
    // Two points are those of the entry in the legend.
    assert_eq!(points(&picture, "#DD6B20"), [numbers, 2]);
    assert_eq!(elements(&picture, "circle").len(), 2 + 2);
    let page = fs::read_to_string(folder.join("report/index.html")).expect("a page");
    for name in ["electrodes.svg", "electrodes.csv", "rate.svg", "rate.csv"] {
        assert!(page.contains(&format!("=\"{name}\"")), "{page}");
    }
    assert!(
        page.contains(&format!("{:.5}", figure("mse_int8"))),
        "{page}"
    );

    // A report is replaced only on request.
    let log = fail(&mut evaluate(folder, &arguments), 2);
    assert!(log.contains("report/index.html exists already"), "{log}");
    succeed(evaluate(folder, &arguments).arg("--force"));
}

#[test]
fn learning_curves_have_all_epochs_also_those_before_a_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write_runs(folder, 2, 30);
    let train = |more: &[&str]| {
        let mut command = trainer("train", "shortcut", folder);
        command
            .args([
                "--train=run1",
                "--test=run2",
                "--out=model",
                "--checkpoint=state",
            ])
            .args(["--learning-rate=1e-2", "--report=report"])
            .args(more);
        command
    };
    succeed(&mut train(&["--epochs=1"]));
    let learning = || Values::read(&folder.join("report/learning.csv"));
    let first = learning();
    assert_eq!(first.column("epoch"), ["0", "1"]);
    succeed(&mut train(&["--epochs=3", "--resume", "--force"]));
    let resumed = learning();
    assert_eq!(resumed.column("epoch"), ["0", "1", "2", "3"]);
    assert_eq!(resumed.rows[..2], first.rows);
    // The shortcut starts as PCA.
    let validation = resumed.numbers("validation_mse");
    assert_near(
        validation[0],
        resumed.numbers("validation_mse_pca")[0],
        1e-5,
    );
    assert_eq!(resumed.column("training_loss")[0], "");
    let best = (0..validation.len()).min_by(|a, b| validation[*a].total_cmp(&validation[*b]));
    let best = best.expect("epochs");
    let card = fs::read_to_string(folder.join("model/model.toml")).expect("the card");
    assert!(card.contains(&format!("best_epoch = {best}")), "{card}");
    let picture = folder.join("report/learning.svg");
    // Blue: validation errors; orange: those of PCA; with the two points of each entry in the legend.
    assert_eq!(points(&picture, "#2B6CB0"), [4, 2]);
    assert_eq!(points(&picture, "#DD6B20"), [2, 2]);
    let page = fs::read_to_string(folder.join("report/index.html")).expect("a page");
    for name in ["learning.svg", "electrodes.svg", "rate.svg"] {
        assert!(page.contains(&format!("src=\"{name}\"")), "{page}");
    }
}

#[test]
fn a_report_that_cannot_be_written_is_found_before_anything_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // Neither a recording nor a model: reading one would fail with other words.
    fs::write(folder.join("run1.gdf"), "nothing").expect("writable");
    fs::write(folder.join("file"), "").expect("writable");
    for report in ["file", "file/report"] {
        let option = format!("--report={report}");
        let mut commands = [
            trainer("train", "shortcut", folder),
            evaluate(folder, &["--test=run1.gdf"]),
        ];
        commands[0].args(["--train=run1", "--out=model"]);
        for command in &mut commands {
            let log = fail(command.arg(&option), 1);
            let expected = format!("{report} cannot be written; name another folder");
            assert!(log.contains(&expected), "{log}");
        }
    }
    // Mode pca has no epochs.
    let mut command = trainer("train", "pca", folder);
    let log = fail(
        command.args(["--train=run1", "--out=model", "--report=report"]),
        2,
    );
    assert!(log.contains("--report has nothing to show"), "{log}");
    assert!(!folder.join("report").exists());
}
