//! The program of docs/importing.md, where PyTorch is installed.

use super::{import_words, run, skip, text};
use artifact::Artifact;
use std::process::Command;

const PAGE: &str = include_str!("../../../../docs/importing.md");
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
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("network.py"), block("# network.py")).expect("a file");
    let spec =
        block("# network.toml").replace("files/montages/", &format!("{}/", any_model::MONTAGES));
    std::fs::write(folder.path().join("network.toml"), spec).expect("a file");
    let output = Command::new(python)
        .arg("network.py")
        .current_dir(folder.path())
        .output()
        .expect("Python starts");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let path = |name: &str| folder.path().join(name);
    let files = ["network.safetensors", "network.toml"].map(path);
    let out = path("model");
    let [printed, _] = run(&import_words(&out, &files), 0);
    assert!(
        printed.contains("The codes of 16 windows equal the exported network's within"),
        "{printed}"
    );
    run(&["check", text(&out)], 0);
    let model = Artifact::read(&out).expect("a model");
    assert_eq!(model.description.training.dataset, "noise, for the example");
}
