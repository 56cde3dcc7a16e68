//! Values of a picture, read from CSV.

use std::fs;
use std::path::Path;

/// Lines of a CSV file after its head, as texts by column.
pub(crate) struct Values {
    head: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Values {
    pub(crate) fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).expect("the values of a picture");
        let mut lines = text.lines().map(|line| {
            let fields = line.split(',').map(str::to_owned);
            fields.collect::<Vec<_>>()
        });
        let head = lines.next().expect("a head");
        let rows: Vec<_> = lines.collect();
        assert!(rows.iter().all(|row| row.len() == head.len()), "{text}");
        Self { head, rows }
    }

    pub(crate) fn column(&self, name: &str) -> Vec<&str> {
        let at = self.head.iter().position(|head| head == name);
        let at = at.unwrap_or_else(|| panic!("no column {name} in {:?}", self.head));
        self.rows.iter().map(|row| row[at].as_str()).collect()
    }

    pub(crate) fn numbers(&self, name: &str) -> Vec<f64> {
        let parse = |text: &str| text.parse().expect("a number");
        self.column(name).into_iter().map(parse).collect()
    }
}

#[expect(clippy::cast_precision_loss, reason = "a few values")]
pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

pub(crate) fn assert_near(value: f64, expected: f64, tolerance: f64) {
    let difference = (value / expected - 1.0).abs();
    assert!(difference < tolerance, "{value} is not {expected}");
}
