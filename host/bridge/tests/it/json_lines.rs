//! The lines of JSON have the fields that docs/json-lines.md lists, and no others.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader};

use rustix::process::Signal;
use serde_json::Value;

use crate::board::Board;
use crate::device::Device;
use crate::process::Bridge;

const PAGE: &str = include_str!("../../../../docs/json-lines.md");

/// Returns the fields that a section of the page lists.
fn listed(section: &str) -> BTreeSet<String> {
    let title = format!("\n## {section}\n");
    let (_, text) = PAGE.split_once(&title).unwrap();
    let text = text.split("\n## ").next().unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.map(|row| row.split('`').next().unwrap().to_owned())
        .collect()
}

/// Adds the fields of a value below `path`. A list of objects has the fields of its elements.
fn collect(value: &Value, path: &str, fields: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (name, value) in object {
                let path = if path.is_empty() {
                    name.clone()
                } else {
                    format!("{path}.{name}")
                };
                collect(value, &path, fields);
            }
        }
        Value::Array(values) if values.iter().any(Value::is_object) => {
            for value in values {
                collect(value, &format!("{path}[]"), fields);
            }
        }
        _ => {
            fields.insert(path.to_owned());
        }
    }
}

#[test]
fn the_lines_have_exactly_the_fields_of_the_page() {
    let device = Device::tcp(Board::new());
    let streams = "--streams=codes,raw,filtered,audit,events";
    let mut bridge = Bridge::start(&["--port", &device.port, "--sink", "ndjson", streams]);
    let mut found: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in BufReader::new(bridge.stdout()).lines() {
        let line: Value = serde_json::from_str(&line.unwrap()).unwrap();
        let names: BTreeSet<String> = line.as_object().unwrap().keys().cloned().collect();
        assert_eq!(names, listed("Every line"));
        let topic = line["topic"].as_str().unwrap().to_owned();
        collect(&line["message"], "", found.entry(topic).or_default());
        if found.len() == 6 && found["/diagnostics"].len() > 4 {
            break;
        }
    }
    bridge.signal(Signal::TERM);
    assert_eq!(found.remove("/events/bus").unwrap(), listed("Events"));
    assert_eq!(found.remove("/diagnostics").unwrap(), listed("Reports"));
    assert_eq!(found.len(), 4, "{:?}", found.keys());
    let frames = listed("Frames");
    for (topic, fields) in found {
        for block in ["eeg.", "exg.", "tri."] {
            let others = ["eeg.", "exg.", "tri."].map(|other| (other, other != block));
            let of_block = fields.iter().filter(|field| {
                let is_other =
                    |(other, differs): &(&str, bool)| *differs && field.starts_with(other);
                !others.iter().any(is_other)
            });
            let of_block = of_block.map(|field| field.replacen(block, "eeg.", 1));
            assert_eq!(
                of_block.collect::<BTreeSet<_>>(),
                frames,
                "{topic}, {block}"
            );
        }
    }
}
