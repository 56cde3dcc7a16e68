//! Elements of an SVG file.

use quick_xml::Reader;
use quick_xml::events::Event;
use std::fs;
use std::path::Path;

/// Returns the elements of an SVG file with this name, each as its attributes. The file must be well-formed.
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

/// Returns the numbers of points of the lines in this colour.
pub(crate) fn points(path: &Path, color: &str) -> Vec<usize> {
    let lines = elements(path, "polyline");
    let lines = lines.iter().filter(|line| line.contains(color));
    let points = lines.filter_map(|line| line.split("points=").nth(1)?.split(';').next());
    points
        .map(|points| points.split_whitespace().count())
        .collect()
}
