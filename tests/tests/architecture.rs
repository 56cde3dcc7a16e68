//! Checks that the crates depend on each other as ARCHITECTURE.md states, and that the rules about files
//! hold.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use acceptance::workspace::{self, Arrows, Names};

/// Largest number of lines of a source file, tests included.
const MAX_LINES: usize = 400;

/// File names that do not describe the contents.
const VAGUE_NAMES: [&str; 6] = ["mod", "util", "utils", "common", "helper", "helpers"];

#[test]
fn arrows_are_those_of_architecture_md() {
    let written = written_arrows();
    let real = workspace::arrows().expect("cargo metadata");
    let names = |all: &BTreeMap<String, Arrows>| all.keys().cloned().collect::<Names>();
    assert_eq!(
        names(&written),
        names(&real),
        "left: ARCHITECTURE.md, right: the workspace"
    );
    let differences: Vec<String> = real
        .iter()
        .filter(|(name, arrows)| written[*name] != **arrows)
        .map(|(name, arrows)| {
            format!(
                "`{name}`:\n  written {:?}\n  real    {arrows:?}",
                written[name]
            )
        })
        .collect();
    assert!(
        differences.is_empty(),
        "ARCHITECTURE.md and the manifests disagree; is the new dependency intended?\n{}",
        differences.join("\n")
    );
}

#[test]
fn no_crate_depends_on_the_acceptance_tests() {
    for (name, arrows) in workspace::arrows().expect("cargo metadata") {
        for kind in [&arrows.normal, &arrows.build, &arrows.tests] {
            assert!(
                !kind.contains("acceptance"),
                "`{name}` depends on `acceptance`"
            );
        }
    }
}

#[test]
fn only_the_files_that_architecture_md_lists_contain_unsafe_code() {
    let mut places = Names::new();
    let mut roots = 0;
    for (name, folder) in folders() {
        let mut files = Vec::new();
        collect_sources(&folder, &mut files);
        let own: Names = files
            .into_iter()
            .filter_map(|file| unsafe_place(&file))
            .collect();
        for root in ["src/lib.rs", "src/main.rs"] {
            let Ok(text) = fs::read_to_string(folder.join(root)) else {
                continue;
            };
            roots += 1;
            assert!(
                text.contains("#![forbid(unsafe_code)]") == own.is_empty(),
                "{name}/{root} forbids unsafe code exactly if none of its files permits it"
            );
        }
        places.extend(own);
    }
    assert!(roots > 10, "found only {roots} crate roots");
    assert_eq!(
        written_unsafe_places(),
        places,
        "left: ARCHITECTURE.md, right: the sources"
    );
}

/// Returns the file's path relative to the root folder if the file permits unsafe code, and `None` otherwise.
fn unsafe_place(file: &Path) -> Option<String> {
    let text = fs::read_to_string(file).expect("a source file");
    let expects = ["expect(", "allow("].iter().any(|attribute| {
        let mut rest = text.split(attribute).skip(1);
        rest.any(|words| words.trim_start().starts_with("unsafe_code,"))
    });
    let root = workspace::root().canonicalize().expect("the root");
    let below = file.strip_prefix(root).expect("a file of the workspace");
    expects.then(|| below.to_string_lossy().into_owned())
}

/// Returns the files that the section "Unsafe code" of ARCHITECTURE.md lists in backticks.
fn written_unsafe_places() -> Names {
    let text = fs::read_to_string(workspace::root().join("ARCHITECTURE.md")).expect("the document");
    let section = text.split("## Unsafe code").nth(1).expect("the section");
    let section = section.split("\n## ").next().expect("a section has text");
    let quoted = section.split('`').skip(1).step_by(2);
    quoted
        .filter(|word| Path::new(word).extension().is_some_and(|e| e == "rs"))
        .map(str::to_owned)
        .collect()
}

#[test]
fn a_source_file_is_short_and_its_name_describes_its_contents() {
    let mut files = Vec::new();
    for folder in folders().values() {
        collect_sources(folder, &mut files);
    }
    assert!(files.len() > 20, "found only {} source files", files.len());
    let mut faults = Vec::new();
    for file in files {
        let lines = fs::read_to_string(&file)
            .expect("a source file")
            .lines()
            .count();
        if lines > MAX_LINES {
            faults.push(format!(
                "{}: {lines} lines, {MAX_LINES} allowed",
                file.display()
            ));
        }
        let stem = file
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if VAGUE_NAMES.contains(&stem.as_str()) {
            faults.push(format!(
                "{}: name the file after the noun that it holds",
                file.display()
            ));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Returns the dependencies in the table "Crates and arrows" of ARCHITECTURE.md, by crate name.
fn written_arrows() -> BTreeMap<String, Arrows> {
    let text = fs::read_to_string(workspace::root().join("ARCHITECTURE.md")).expect("the document");
    let (_, section) = text
        .split_once("\n## Crates and arrows\n")
        .expect("the section");
    let section = section.split("\n## ").next().unwrap_or(section);
    let mut table = BTreeMap::new();
    for line in section.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').collect();
        let [name, _purpose, normal, build, tests] = cells[..] else {
            panic!("a row has five cells: {line}");
        };
        let arrows = Arrows {
            normal: names_in(normal),
            build: names_in(build),
            tests: names_in(tests),
        };
        let name = names_in(name).pop_first().expect("the crate's name");
        assert!(
            table.insert(name.clone(), arrows).is_none(),
            "`{name}` has two rows"
        );
    }
    table
}

/// Returns the names that a cell of the table contains in backticks.
fn names_in(cell: &str) -> Names {
    cell.split('`')
        .skip(1)
        .step_by(2)
        .map(str::to_owned)
        .collect()
}

/// Returns the folder of every member by name, and that of the virtual boards, which are a separate
/// workspace.
fn folders() -> BTreeMap<String, PathBuf> {
    let mut folders = workspace::folders().expect("cargo metadata");
    let root = workspace::root().canonicalize().expect("the root");
    folders.insert("virtual-board".to_owned(), root.join("tests/virtual-board"));
    folders
}

/// Adds every `.rs` file below a member's folder. Skips `target`, and folders with a manifest of their own,
/// which are other members.
fn collect_sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry"))
    {
        let path = entry.path();
        let is_source = path.file_name().is_none_or(|name| name != "target")
            && !path.join("Cargo.toml").exists();
        if path.is_dir() {
            if is_source {
                collect_sources(&path, files);
            }
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
}
