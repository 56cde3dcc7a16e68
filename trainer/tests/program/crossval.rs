//! `trainer crossval` and `trainer merge`.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::picture_file::{elements, points};
use crate::values::{Values, assert_near, mean};
use crate::{fail, succeed, trainer, write_runs};

fn crossval(mode: &str, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = trainer("crossval", mode, folder);
    command
        .args(["--folds=2", "--repetitions=2", "--epochs=1"])
        .args(arguments);
    command
}

fn merge(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
    command.arg("merge").args(arguments).current_dir(folder);
    command
}

#[test]
fn merged_shards_are_the_table_of_one_process_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 3, 24);
    let whole = succeed(&mut crossval("pca", folder.path(), &["--out=whole"]));
    for shard in ["1/3", "2/3", "3/3"] {
        let out = format!("--out=shard{}", &shard[..1]);
        let printed = succeed(&mut crossval(
            "pca",
            folder.path(),
            &[&out, "--shard", shard],
        ));
        assert_eq!(printed, "", "the folds of other shards are missing");
    }
    let error = fail(
        &mut merge(folder.path(), &["shard1", "shard2", "--out=table"]),
        1,
    );
    assert!(error.contains("folds are missing: all-r"), "{error}");
    let arguments = ["shard1", "shard2", "shard3", "--out=table"];
    let merged = succeed(&mut merge(folder.path(), &arguments));
    assert_eq!(merged, whole);
    for name in ["table.md", "table.csv", "table.json"] {
        let read = |out: &str| fs::read(folder.path().join(out).join(name)).expect("a table");
        assert_eq!(read("table"), read("whole"), "{name}");
    }
    // Shards may also share a folder: the last one makes the table.
    for shard in ["1/2", "2/2"] {
        succeed(&mut crossval(
            "pca",
            folder.path(),
            &["--out=shared", "--shard", shard],
        ));
    }
    let shared = fs::read(folder.path().join("shared/table.json")).expect("a table");
    let whole = fs::read(folder.path().join("whole/table.json")).expect("a table");
    assert_eq!(shared, whole);
}

#[test]
fn finished_folds_are_kept_and_other_settings_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 2, 24);
    let table = succeed(&mut crossval("shortcut", folder.path(), &["--out=out"]));
    let missing = folder.path().join("out/folds/all-r2-f1.json");
    let before = fs::read(&missing).expect("an outcome");
    fs::remove_file(&missing).expect("an outcome");
    let again = crossval("shortcut", folder.path(), &["--out=out"])
        .output()
        .expect("the program starts");
    assert_eq!(String::from_utf8_lossy(&again.stdout), table);
    let log = String::from_utf8_lossy(&again.stderr).into_owned();
    assert_eq!(log.matches("done before").count(), 3, "{log}");
    assert_eq!(fs::read(&missing).expect("an outcome"), before);
    let error = fail(
        &mut crossval("shortcut", folder.path(), &["--out=out", "--seed=2"]),
        2,
    );
    assert!(
        error.contains("belongs to another cross-validation") && error.contains("seed 2"),
        "{error}"
    );
}

#[test]
fn one_recording_is_divided_into_blocks_and_too_few_runs_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 1, 60);
    let error = fail(
        &mut crossval("shortcut", folder.path(), &["--out=out", "--blocks=1"]),
        2,
    );
    assert!(error.contains("1 runs or blocks for 2 folds"), "{error}");
    let table = succeed(&mut crossval(
        "shortcut",
        folder.path(),
        &["--out=out", "--subject=me"],
    ));
    assert!(
        table.contains("| me | 4 | shortcut | float | yes |"),
        "{table}"
    );
    assert!(table.contains("blocks, 4 in each run"), "{table}");
}

#[test]
fn pictures_have_every_fold_its_mean_and_its_epochs() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write_runs(folder, 2, 24);
    fs::write(folder.join("file"), "").expect("writable");
    let log = fail(
        &mut crossval("shortcut", folder, &["--out=out", "--report=file"]),
        1,
    );
    assert!(log.contains("file cannot be written"), "{log}");
    assert!(!folder.join("out").exists());
    let arguments = ["--out=out", "--report=report"];
    succeed(&mut crossval("shortcut", folder, &arguments));
    let folds = Values::read(&folder.join("report/folds.csv"));
    // 2 folds, 2 repetitions; model and PCA, float and integer codes.
    assert_eq!(folds.rows.len(), 16);
    let table = Values::read(&folder.join("out/table.csv"));
    let models = table.column("model").into_iter().zip(table.column("codes"));
    let means = table
        .numbers("mse_mean")
        .into_iter()
        .zip(table.numbers("mse_sd"));
    for ((model, codes), (expected, sd)) in models.zip(means) {
        let all = folds.column("model").into_iter().zip(folds.column("codes"));
        let errors = all.zip(folds.numbers("mse"));
        let errors: Vec<f64> = errors
            .filter(|(kind, _)| *kind == (model, codes))
            .map(|(_, mse)| mse)
            .collect();
        assert_eq!(errors.len(), 4);
        assert_near(mean(&errors), expected, 1e-12);
        let squares = errors.iter().map(|mse| (mse - expected).powi(2));
        assert_near((squares.sum::<f64>() / 3.0).sqrt(), sd, 1e-9);
    }
    // Of each of four kinds: four folds, the mean and the legend; a bar at each mean.
    let picture = folder.join("report/folds.svg");
    assert_eq!(elements(&picture, "circle").len(), 4 * (4 + 1 + 1));
    assert_eq!(points(&picture, "#2B6CB0"), [2, 2]);
    assert_eq!(points(&picture, "#DD6B20"), [2, 2]);

    let learning = Values::read(&folder.join("report/learning.csv"));
    assert_eq!(learning.column("epoch"), ["0", "1"].repeat(4));
    // The shortcut starts as PCA.
    for (epoch, (mse, pca)) in learning
        .numbers("validation_mse")
        .into_iter()
        .zip(learning.numbers("validation_mse_pca"))
        .enumerate()
    {
        if epoch % 2 == 0 {
            assert_near(mse, pca, 1e-5);
        }
    }
    // The curves of four folds, and the entry in the legend.
    assert_eq!(
        points(&folder.join("report/learning.svg"), "#2B6CB0"),
        [2; 5]
    );
    // Finished folds are enough for another report.
    let mut merge = merge(folder, &["out", "--out=merged", "--report=again"]);
    succeed(&mut merge);
    for name in ["index.html", "folds.svg", "learning.svg"] {
        let read = |report: &str| fs::read(folder.join(report).join(name)).expect("a file");
        assert_eq!(read("again"), read("report"), "{name}");
    }
    assert!(fail(&mut merge, 2).contains("--force"));
}

#[test]
fn index_unpooling_is_compared_but_not_called_decodable() {
    let folder = tempfile::tempdir().expect("a folder");
    write_runs(folder.path(), 2, 24);
    let mut command = trainer("crossval", "paper", folder.path());
    command.args(["--folds=2", "--repetitions=1", "--epochs=1", "--out=out"]);
    let table = succeed(&mut command);
    assert!(
        table.contains("| all | 2 | paper | float | no |"),
        "{table}"
    );
    assert!(!table.contains("paper | integer"), "{table}");
    assert!(table.contains("PCA-16 | integer | yes"), "{table}");
}
