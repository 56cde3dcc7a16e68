//! The program of docs/importing.md, where PyTorch is installed.

use super::import::IMPORT;
use super::{Folder, skip};
use artifact::Artifact;
use std::process::Command;

const PAGE: &str = include_str!("../../../docs/importing.md");
/// Python interpreters, tried in this order.
const PYTHONS: [&str; 2] = ["python3", "/usr/bin/python3"];

/// Returns the block of the page that starts with a line.
fn block(first_line: &str) -> &'static str {
    let (_, rest) = PAGE
        .split_once(&format!("{first_line}\n"))
        .expect("a block of the page");
    rest.split_once("\n```").expect("the end of the block").0
}

#[test]
fn the_pages_program_exports_a_network_that_the_import_accepts() {
    let imports = |python: &&&str| {
        let mut command = Command::new(python);
        let output = command
            .args(["-c", "import torch, safetensors.torch"])
            .output();
        output.is_ok_and(|output| output.status.success())
    };
    let Some(python) = PYTHONS.iter().find(imports) else {
        let why = format!(
            "neither {} imports torch and safetensors",
            PYTHONS.join(" nor ")
        );
        skip("docs/importing.md", &why);
        return;
    };
    let folder = Folder::new();
    folder.write("network.py", block("# network.py"));
    let montages = format!("{}/", any_model::MONTAGES);
    let spec = block("# network.toml").replace("files/montages/", &montages);
    folder.write("network.toml", &spec);
    let mut command = Command::new(python);
    let output = command
        .arg("network.py")
        .current_dir(folder.path(""))
        .output();
    let output = output.expect("Python starts");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{log}");
    let printed = folder.succeed(IMPORT);
    let words = "The codes of 16 windows equal the exported network's within";
    assert!(printed.contains(words), "{printed}");
    folder.succeed("check model");
    let model = Artifact::read(&folder.path("model")).expect("a model");
    assert_eq!(model.description.training.dataset, "noise, for the example");
}
