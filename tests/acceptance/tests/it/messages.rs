//! Messages to the user contain none of Rust's debug output, such as escaped quotes or enum names.

use std::fs;
use std::path::{Path, PathBuf};

use acceptance::workspace;

/// Crates that contain messages which a user of the programs sees.
const CRATES: [&str; 14] = [
    "artifact",
    "bench",
    "bridge",
    "bridge-core",
    "capture",
    "demo",
    "host-sim",
    "model-gen",
    "neuro-ros",
    "new-file",
    "node",
    "recordings",
    "ros1",
    "trainer",
];

/// For each kind of message, the texts with which it begins and ends in the source code.
const MESSAGES: [(&str, &str); 9] = [
    ("#[error(", ")]"),
    ("println!(", ");"),
    ("ensure!(", ");"),
    ("bail!(", ");"),
    ("found: format!(", "),"),
    ("info!(", ");"),
    ("warn!(", ");"),
    ("error!(", ");"),
    ("write!(", ");"),
];

#[test]
fn no_message_to_the_user_has_debug_output() {
    let mut packages = workspace::packages("Cargo.toml").expect("cargo metadata");
    packages.retain(|package| CRATES.contains(&&package.name[..]));
    assert_eq!(packages.len(), CRATES.len(), "a crate of the list is missing");
    let mut found = Vec::new();
    let mut messages = 0;
    for package in packages {
        let mut files = Vec::new();
        collect(&package.folder.join("src"), &mut files);
        for file in files {
            let text = fs::read_to_string(&file).expect("a source file");
            // Leave out the file's unit tests, which come last in it.
            let text = text.split("#[cfg(test)]").next().unwrap_or_default();
            // Leave out what the emulated microcontroller prints, because only programs read it.
            let text = text.replace("hprintln!(", "");
            for (start, end) in MESSAGES {
                for rest in text.split(start).skip(1) {
                    messages += 1;
                    let message = rest.split(end).next().unwrap_or_default();
                    if is_debug(message) {
                        found.push(format!("{}: {start}{message}", file.display()));
                    }
                }
            }
        }
    }
    assert!(messages > 300, "found only {messages} messages");
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Returns whether a message formats a value with `{:?}`, or with `?` as a field of the log.
fn is_debug(message: &str) -> bool {
    let has_field = message.split(['(', ',', ' ']).any(|word| {
        let field = word.trim().strip_prefix('?');
        field.is_some_and(|name| name.starts_with(|c: char| c.is_ascii_lowercase()))
    });
    message.contains(":?}") || has_field
}

/// Adds to `files` the Rust files below a folder, except those that contain only tests.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs")
            && !path.ends_with("tests.rs")
            && !path.ends_with("rosout.rs")
        {
            files.push(path);
        }
    }
}
