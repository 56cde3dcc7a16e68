//! Tests of tables that are worked out by hand.

use super::super::outcome::Validation;
use super::*;

fn errors(mse: f64) -> Errors {
    Errors {
        mse,
        mse_uv2: 100.0 * mse,
        prd_percent: 10.0,
    }
}

fn outcome(subject: &str, fold: usize, mse: f64) -> Outcome {
    Outcome {
        settings: "montage m; 2 epochs; 2 folds of whole runs".to_owned(),
        subject: subject.to_owned(),
        repetition: 1,
        fold,
        mode: "shortcut".to_owned(),
        numbers: 16,
        is_decodable: true,
        tested_on: "a.edf".to_owned(),
        windows: 10,
        sd_uv: 10.0,
        best_epoch: 2,
        validation: Validation {
            model: 0.1,
            pca: 0.2,
        },
        curve: None,
        model_float: Some(errors(mse)),
        model_integer: Some(errors(2.0 * mse)),
        pca_float: errors(3.0 * mse),
        pca_integer: errors(4.0 * mse),
    }
}

fn two_subjects() -> Vec<Outcome> {
    [("a", 1, 1.0), ("a", 2, 3.0), ("b", 1, 5.0), ("b", 2, 7.0)]
        .map(|(subject, fold, mse)| outcome(subject, fold, mse))
        .into()
}

#[test]
fn mean_and_deviation_are_over_folds_and_over_the_means_of_subjects() {
    let table = Table::new(two_subjects()).unwrap();
    assert_eq!(table.rows.len(), 12);
    let row = |subject: &str, model: &str, codes: &str| {
        let is = |row: &&Row| row.subject == subject && row.model == model && row.codes == codes;
        table.rows.iter().find(is).unwrap().mse
    };
    let spread = |mean, sd| Spread { mean, sd };
    // The sample deviation of two values is their difference over the root of 2.
    let root = 2.0_f64.sqrt();
    assert_eq!(row("a", "shortcut", "float"), spread(2.0, root));
    assert_eq!(row("b", "PCA-16", "integer"), spread(24.0, 4.0 * root));
    // Subject means 2 and 6.
    let all = row("all", "shortcut", "float");
    assert!(
        (all.mean - 4.0).abs() < 1e-12 && (all.sd - 4.0 / root).abs() < 1e-12,
        "{all:?}"
    );
}

#[test]
fn the_table_does_not_depend_on_the_order_of_the_outcomes() {
    let table = Table::new(two_subjects()).unwrap();
    let mut reversed = two_subjects();
    reversed.reverse();
    let other = Table::new(reversed).unwrap();
    assert_eq!(other.to_string(), table.to_string());
    assert_eq!(other.csv(), table.csv());
    assert_eq!(table.csv().lines().count(), 1 + table.rows.len());
}

#[test]
fn missing_mixed_and_absent_outcomes_are_named() {
    let mut outcomes = two_subjects();
    outcomes.remove(2);
    let error = Table::new(outcomes).unwrap_err().to_string();
    assert!(error.contains("b-r1-f1"), "{error}");
    let mut outcomes = two_subjects();
    outcomes[1].settings = "montage m; 9 epochs; 2 folds of whole runs".to_owned();
    let error = Table::new(outcomes).unwrap_err().to_string();
    assert!(
        error.contains("9 epochs") && error.contains("a-r1-f2"),
        "{error}"
    );
    assert!(matches!(
        Table::new(Vec::new()),
        Err(TrainerError::NoOutcomes)
    ));
}

#[test]
fn codes_that_cannot_be_decoded_have_no_row_of_integers() {
    let mut outcomes = two_subjects();
    for outcome in &mut outcomes {
        outcome.model_integer = None;
        outcome.is_decodable = false;
    }
    let text = Table::new(outcomes).unwrap().to_string();
    assert!(text.contains("| a | 2 | shortcut | float | no |"), "{text}");
    assert!(!text.contains("shortcut | integer"), "{text}");
}
