//! The MD5 sums equal those of the packages that consumers were built with, and the full
//! definitions contain every embedded type.

use std::collections::HashMap;
use std::path::Path;

use md5::{Digest, Md5};
use neuro_ros::{
    DiagnosticArray, EMPTY, GET_ACQUISITION_INFO, Log, NeuroEvent, NeuroFrame, NeuroOutput,
    RosMessage, UInt8,
};

/// Reads every `.msg` file; the keys are `package/Name`.
fn definitions() -> HashMap<String, String> {
    let mut found = HashMap::new();
    for (package, folder) in [
        ("rosneuro_msgs", "../../ros/rosneuro_msgs/msg"),
        ("std_msgs", "foreign/std_msgs"),
        ("diagnostic_msgs", "foreign/diagnostic_msgs"),
        ("rosgraph_msgs", "foreign/rosgraph_msgs"),
    ] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap().to_str().unwrap();
            let text = std::fs::read_to_string(&path).unwrap();
            found.insert(format!("{package}/{name}"), text);
        }
    }
    found
}

/// Splits a definition into its fields and constants, each as a pair (type, rest of the line).
fn lines(text: &str) -> Vec<(String, String)> {
    text.lines()
        .map(|line| line.split('#').next().unwrap().trim())
        .filter(|line| !line.is_empty())
        .map(|line| line.split_once(char::is_whitespace).unwrap())
        .map(|(kind, rest)| (kind.to_owned(), rest.trim().to_owned()))
        .collect()
}

/// Returns the `package/Name` of a field's type, or `None` for a built-in type.
fn embedded(kind: &str, package: &str, all: &HashMap<String, String>) -> Option<String> {
    let kind = kind.split('[').next().unwrap();
    let name = match kind {
        "Header" => "std_msgs/Header".to_owned(),
        kind if kind.contains('/') => kind.to_owned(),
        kind => format!("{package}/{kind}"),
    };
    all.contains_key(&name).then_some(name)
}

/// Returns the text over which ROS computes the MD5 sum: constants first, then fields, with each
/// embedded type replaced by its MD5 sum.
fn md5_text(text: &str, package: &str, all: &HashMap<String, String>) -> String {
    let (constants, fields): (Vec<_>, Vec<_>) =
        lines(text).into_iter().partition(|(_, rest)| rest.contains('='));
    let constants = constants.into_iter().map(|(kind, rest)| format!("{kind} {rest}"));
    let fields = fields.into_iter().map(|(kind, rest)| {
        embedded(&kind, package, all)
            .map_or_else(|| format!("{kind} {rest}"), |name| format!("{} {rest}", md5(&name, all)))
    });
    constants.chain(fields).collect::<Vec<_>>().join("\n")
}

fn md5(name: &str, all: &HashMap<String, String>) -> String {
    let (package, _) = name.split_once('/').unwrap();
    hex(&md5_text(&all[name], package, all))
}

fn hex(text: &str) -> String {
    let digits: Vec<String> =
        Md5::digest(text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect();
    digits.concat()
}

/// Returns the full definition as `gendeps --cat` prints it: the text of `name`, then each embedded
/// type once. The types are in depth-first order of their first use.
fn full_text(name: &str, all: &HashMap<String, String>) -> String {
    fn collect(name: &str, all: &HashMap<String, String>, parts: &mut Vec<String>) {
        let (package, _) = name.split_once('/').unwrap();
        for (kind, _) in lines(&all[name]) {
            let Some(part) = embedded(&kind, package, all) else {
                continue;
            };
            if !parts.contains(&part) {
                parts.push(part.clone());
                collect(&part, all, parts);
            }
        }
    }
    let mut parts = Vec::new();
    collect(name, all, &mut parts);
    let separator = "=".repeat(80);
    let parts = parts.iter().map(|part| format!("\n{separator}\nMSG: {part}\n{}", all[part]));
    std::iter::once(all[name].clone()).chain(parts).collect()
}

#[test]
fn md5_sums_of_the_original_packages_are_those_of_the_definition_files() {
    let all = definitions();
    for announced in [
        NeuroFrame::TYPE,
        NeuroEvent::TYPE,
        NeuroOutput::TYPE,
        DiagnosticArray::TYPE,
        Log::TYPE,
        UInt8::TYPE,
    ] {
        let name = announced.name;
        assert_eq!(announced.md5, md5(name, &all), "{name}");
        assert_eq!(announced.definition, full_text(name, &all), "{name}");
    }
}

#[test]
fn md5_sums_of_services_cover_request_and_response() {
    let all = definitions();
    for service in [&GET_ACQUISITION_INFO, &EMPTY] {
        let (request, response) = service.definition.split_once("---\n").unwrap();
        let text = [request, response].map(|part| md5_text(part, "rosneuro_msgs", &all)).concat();
        assert_eq!(hex(&text), service.md5, "{}", service.name);
    }
    assert_eq!(GET_ACQUISITION_INFO.md5, "8cf1aae8f1ae02fdc8775b1362badac5");
}
