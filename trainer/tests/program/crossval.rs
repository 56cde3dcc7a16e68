//! `trainer crossval` and `trainer merge`.

use std::fs;
use std::path::Path;
use std::process::Command;

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
