//! Tests of `trainer crossval`.

use super::files::{Values, assert_near, elements, mean, points};
use super::people::three;
use super::{Folder, SMALL, assert_has};
use artifact::Artifact;
use std::fs;

/// Returns the command of a cross-validation with two folds and two repetitions.
fn crossval(mode: &str, arguments: &str) -> String {
    format!("crossval {SMALL} --mode={mode} --folds=2 --repetitions=2 --epochs=1 {arguments}")
}

#[test]
fn shards_in_one_folder_make_the_table_of_one_process_bit_for_bit() {
    let folder = Folder::with_runs(3, 24);
    let whole = folder.succeed(&crossval("pca", "--out=whole"));
    let shard = |shard| folder.succeed(&crossval("pca", &format!("--out=shared --shard={shard}")));
    assert_eq!(shard("1/2"), "", "the folds of the other shard are missing");
    // The shard that finishes last writes the table.
    assert_eq!(shard("2/2"), whole);
    for name in ["table.md", "table.csv", "table.json"] {
        let read = |out: &str| folder.read(&format!("{out}/{name}"));
        assert_eq!(read("shared"), read("whole"), "{name}");
    }
}

#[test]
fn finished_folds_are_kept_and_other_settings_refused() {
    let folder = Folder::with_runs(2, 24);
    let table = folder.succeed(&crossval("pca", "--out=out"));
    let missing = "out/folds/all-r2-f1.json";
    let before = folder.read(missing);
    fs::remove_file(folder.path(missing)).expect("an outcome");
    let [again, log] = folder.run(&crossval("pca", "--out=out"), 0);
    assert_eq!(again, table);
    assert_eq!(log.matches("done before").count(), 3, "{log}");
    assert_eq!(folder.read(missing), before);
    let error = folder.fail(&crossval("pca", "--out=out --seed=2"), 2);
    assert_has(&error, &["belongs to another cross-validation", "seed 2"]);
}

#[test]
fn one_recording_is_divided_into_blocks_and_too_few_runs_are_refused() {
    let folder = Folder::with_runs(1, 60);
    let error = folder.fail(&crossval("pca", "--out=out --blocks=1"), 2);
    assert!(error.contains("1 runs or blocks for 2 folds"), "{error}");
    let table = folder.succeed(&crossval("pca", "--out=out --subject=me"));
    assert_has(&table, &["| me | 4 | PCA-16 | float | yes |", "blocks, 4 in each run"]);
}

#[test]
fn the_picture_has_every_fold_and_its_mean() {
    let folder = Folder::with_runs(2, 24);
    folder.write("file", "");
    let log = folder.fail(&crossval("shortcut", "--out=out --report=file"), 1);
    assert!(log.contains("file cannot be written"), "{log}");
    assert!(!folder.path("out").exists());
    folder.succeed(&crossval("shortcut", "--out=out --report=report"));
    let folds = Values::read(&folder.path("report/folds.csv"));
    // 2 folds, 2 repetitions, 2 models (network and PCA), and float and integer codes: 16 rows.
    assert_eq!(folds.rows.len(), 16);
    let table = Values::read(&folder.path("out/table.csv"));
    let models = table.column("model").into_iter().zip(table.column("codes"));
    let means = table.numbers("mse_mean").into_iter();
    for ((model, codes), (expected, sd)) in models.zip(means.zip(table.numbers("mse_sd"))) {
        let all = folds.column("model").into_iter().zip(folds.column("codes"));
        let errors = all.zip(folds.numbers("mse"));
        let errors = errors.filter(|(kind, _)| *kind == (model, codes));
        let errors: Vec<f64> = errors.map(|(_, mse)| mse).collect();
        assert_eq!(errors.len(), 4);
        assert_near(mean(&errors), expected, 1e-12);
        let squares = errors.iter().map(|mse| (mse - expected).powi(2));
        assert_near((squares.sum::<f64>() / 3.0).sqrt(), sd, 1e-9);
    }
    // Each of the four kinds of code has circles for four folds, for their mean and for the legend.
    // Two kinds share each colour. The mean of each kind has a bar, a line of two points.
    let picture = folder.path("report/folds.svg");
    assert_eq!(elements(&picture, "circle").len(), 4 * (4 + 1 + 1));
    assert_eq!(points(&picture, "#2B6CB0"), [2, 2]);
    assert_eq!(points(&picture, "#DD6B20"), [2, 2]);

    // A later call finds all folds done and writes another report.
    let again = crossval("shortcut", "--out=out --report=again");
    folder.succeed(&again);
    for name in ["index.html", "folds.svg"] {
        let read = |report: &str| folder.read(&format!("{report}/{name}"));
        assert_eq!(read("again"), read("report"), "{name}");
    }
    assert!(folder.fail(&again, 2).contains("--force"));
}

#[test]
fn index_unpooling_is_compared_but_not_called_decodable() {
    let folder = Folder::with_runs(2, 24);
    let crossval = "--mode=paper --folds=2 --repetitions=1 --epochs=1 --out=out";
    let table = folder.succeed(&format!("crossval {SMALL} {crossval}"));
    assert_has(&table, &["| all | 2 | paper | float | no |", "PCA-16 | integer | yes"]);
    assert!(!table.contains("paper | integer"), "{table}");
}

#[test]
fn each_person_is_tested_with_a_model_of_the_others() {
    let folder = three();
    let small = SMALL.replace("--data=.", "");
    let table = folder.succeed(&format!(
        "crossval {small} --mode=pca --data=[A-C]1 --leave-one-person-out --out=out"
    ));
    assert_has(&table, &["| all | 3 | PCA-16 | float | yes |", "each of A1 B1 C1 with a model"]);
    // `trainer train` on the recordings of the other people trains the same model; its card states
    // the error on the left-out person.
    let table = Values::read(&folder.path("out/table.csv"));
    let prd = |subject: &str, codes: &str| {
        let subjects = table.column("subject").into_iter();
        let rows = subjects.zip(table.column("codes"));
        let mut rows = rows.zip(table.numbers("prd_percent_mean"));
        let row = rows.find(|(row, _)| *row == (subject, codes));
        row.expect("a row").1
    };
    for codes in ["float", "integer"] {
        let people = ["A1", "B1", "C1"].map(|subject| prd(subject, codes));
        assert_near(prd("all", codes), mean(&people), 1e-12);
    }
    for (subject, others) in [("A1", "[BC]1"), ("B1", "[AC]1"), ("C1", "[AB]1")] {
        folder.succeed(&format!(
            "train {small} --mode=pca --data={others} --train=R01..R03 --test={subject} --out={subject}-model"
        ));
        let model = Artifact::read(&folder.path(&format!("{subject}-model"))).expect("a model");
        let expected = model.description.training.prd_percent.expect("figures");
        assert_near(prd(subject, "float"), expected.pca_float, 1e-6);
        assert_near(prd(subject, "integer"), expected.pca_int8, 1e-6);
    }
    let error = folder.fail(
        &format!("crossval {small} --mode=pca --data=A1 --leave-one-person-out --out=one"),
        2,
    );
    assert_has(&error, &["of one person, A1", "several people"]);
}
