//! Reads the files of a report: elements of pictures, and values of CSV files.

use quick_xml::Reader;
use quick_xml::events::Event;
use std::fs;
use std::path::Path;

/// Returns the elements called `name` of an SVG file, each as the text of its attributes. The file
/// must be well-formed.
pub(crate) fn elements(path: &Path, name: &str) -> Vec<String> {
    let text = fs::read_to_string(path).expect("a picture");
    let mut reader = Reader::from_str(&text);
    let mut elements = Vec::new();
    loop {
        match reader.read_event().expect("XML") {
            Event::Start(element) | Event::Empty(element) => {
                if element.name().as_ref() != name {
                    continue;
                }
                let attributes = element.attributes().map(|attribute| {
                    let attribute = attribute.expect("an attribute");
                    let (key, value) = (attribute.key, attribute.value);
                    format!("{}={value};", key.as_ref())
                });
                elements.push(attributes.collect());
            }
            Event::Eof => return elements,
            _ => {}
        }
    }
}

/// Returns the number of points of each line of this colour in a picture.
pub(crate) fn points(path: &Path, color: &str) -> Vec<usize> {
    let lines = elements(path, "polyline");
    let lines = lines.iter().filter(|line| line.contains(color));
    let points = lines.filter_map(|line| line.split("points=").nth(1)?.split(';').next());
    points.map(|points| points.split_whitespace().count()).collect()
}

/// A CSV file: the names of its columns, and the values of its rows as text.
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
