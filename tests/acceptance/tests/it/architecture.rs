//! Checks that crates and their groups depend on each other only as ARCHITECTURE.md states, that
//! only the files listed there contain unsafe code, and that cargo compiles every source file.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use acceptance::workspace::{self, Arrows, Names, Package};

/// Largest number of folders, hidden ones included, that the root folder may have.
const MAX_FOLDERS: usize = 16;

/// One row of the tables of crates in ARCHITECTURE.md, section "Crates and arrows".
#[derive(Debug, PartialEq, Eq)]
struct Row {
    /// Position of the crate's group in ARCHITECTURE.md, counted from the top. A crate may depend
    /// only on crates at the same or a smaller position.
    position: usize,
    /// Group of the crate, which is the first folder of its path.
    group: String,
    arrows: Arrows,
}

#[test]
fn crates_and_arrows_are_those_of_architecture_md() {
    let mut written = rows();
    let positions: BTreeMap<String, usize> =
        written.iter().map(|(name, row)| (name.clone(), row.position)).collect();
    let mut faults = Vec::new();
    for package in workspace::packages("Cargo.toml").expect("cargo metadata") {
        let (name, arrows) = (package.name, package.arrows);
        let Some(row) = written.remove(&name) else {
            faults.push(format!("`{name}` has no row"));
            continue;
        };
        if row.arrows != arrows {
            let written = &row.arrows;
            faults.push(format!("`{name}`:\n  written {written:?}\n  real    {arrows:?}"));
        }
        let group = first_folder(&package.folder);
        if row.group != group {
            faults.push(format!("`{name}` is in `{group}/`, written in `{}/`", row.group));
        }
        let all = arrows.normal.iter().chain(&arrows.build).chain(&arrows.tests);
        let later = all.filter(|other| positions.get(*other) > Some(&row.position));
        faults.extend(later.map(|other| format!("`{name}` depends on `{other}` of a later group")));
    }
    faults.extend(written.keys().map(|name| format!("`{name}` has a row and does not exist")));
    assert!(
        faults.is_empty(),
        "ARCHITECTURE.md and the manifests disagree; is the new dependency intended?\n{}",
        faults.join("\n")
    );
}

#[test]
fn the_root_has_few_folders() {
    let files =
        Command::new("git").arg("ls-files").current_dir(workspace::root()).output().expect("git");
    let files = String::from_utf8_lossy(&files.stdout);
    let folders: Names = files
        .lines()
        .filter_map(|file| file.split_once('/'))
        .map(|(folder, _)| folder.to_owned())
        .collect();
    assert!((7..=MAX_FOLDERS).contains(&folders.len()), "the root has these folders: {folders:?}");
}

#[test]
fn only_the_files_that_architecture_md_lists_contain_unsafe_code() {
    let mut places = Names::new();
    let mut roots = 0;
    for Package { name, folder, .. } in packages() {
        let own: Names =
            sources(&folder).into_iter().filter_map(|file| unsafe_place(&file)).collect();
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
    assert_eq!(written_unsafe_places(), places, "left: ARCHITECTURE.md, right: the sources");
}

/// Checks that cargo compiles every `.rs` file: it must be the root of a target, or another file
/// must declare it with `mod`, by its name or with the attribute `path`.
#[test]
fn every_source_file_is_declared_by_a_module() {
    let packages = packages();
    let files: Vec<PathBuf> =
        packages.iter().flat_map(|package| sources(&package.folder)).collect();
    assert!(files.len() > 500, "found only {} files", files.len());
    let mut declared = Names::new();
    for file in &files {
        let text = fs::read_to_string(file).expect("a source file");
        let declarations = text.lines().filter_map(|line| line.strip_suffix(';'));
        let names = declarations.filter_map(|line| Some(line.rsplit_once("mod ")?.1.to_owned()));
        declared.extend(names);
        let lines = text.lines().map(str::trim_start);
        let paths = lines
            .filter_map(|line| line.strip_prefix("#[path = \"")?.strip_suffix(".rs\"]"))
            .filter_map(|path| path.rsplit('/').next());
        declared.extend(paths.map(str::to_owned));
    }
    let is_declared = |file: &Path| {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        declared.contains(stem.as_ref())
    };
    let is_root = |file: &PathBuf| packages.iter().any(|package| package.roots.contains(file));
    let orphans: Vec<_> =
        files.iter().filter(|file| !is_declared(file) && !is_root(file)).collect();
    assert!(
        orphans.is_empty(),
        "nothing compiles these files; delete them, or declare them with `mod`:\n{orphans:#?}"
    );
}

/// Returns the path of `file` relative to the root folder if an attribute in it permits unsafe
/// code; otherwise `None`.
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

/// Returns the files that ARCHITECTURE.md lists in backticks in its section "Unsafe code".
fn written_unsafe_places() -> Names {
    let section = section("Unsafe code");
    let quoted = section.split('`').skip(1).step_by(2);
    quoted
        .filter(|word| Path::new(word).extension().is_some_and(|e| e == "rs"))
        .map(str::to_owned)
        .collect()
}

/// Returns, by the name of the crate, the rows of the tables in the section "Crates and arrows" of
/// ARCHITECTURE.md.
fn rows() -> BTreeMap<String, Row> {
    let mut table = BTreeMap::new();
    let section = section("Crates and arrows");
    for (position, group) in section.split("\n### ").skip(1).enumerate() {
        let name_of_group = group.split(['`', '/']).nth(1).expect("the group's name");
        for line in group.lines().filter(|line| line.starts_with("| `")) {
            let cells: Vec<&str> = line.trim_matches('|').split('|').collect();
            let [name, _purpose, arrows] = cells[..] else {
                panic!("a row has three cells: {line}");
            };
            let mut row =
                Row { position, group: name_of_group.to_owned(), arrows: Arrows::default() };
            for part in arrows.split(';') {
                let part = part.trim();
                let names = match part.split_once(": ") {
                    Some(("build", _)) => &mut row.arrows.build,
                    Some(("tests", _)) => &mut row.arrows.tests,
                    _ => &mut row.arrows.normal,
                };
                *names = names_in(part);
            }
            let name = names_in(name).pop_first().expect("the crate's name");
            let former = table.insert(name, row);
            assert!(former.is_none(), "two rows for one crate: {line}");
        }
    }
    table
}

/// Returns the section of ARCHITECTURE.md that has the given heading.
fn section(heading: &str) -> String {
    let text = fs::read_to_string(workspace::root().join("ARCHITECTURE.md")).expect("the document");
    let (_, section) = text.split_once(&format!("\n## {heading}\n")).expect("the section");
    section.split("\n## ").next().unwrap_or(section).to_owned()
}

/// Returns the names in backticks in a table's cell.
fn names_in(cell: &str) -> Names {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Returns the first folder, counted from the root folder, in the path of a crate.
fn first_folder(folder: &Path) -> String {
    let root = workspace::root().canonicalize().expect("the root");
    let below = folder.strip_prefix(root).expect("a folder of the workspace");
    let first = below.iter().next().unwrap_or_default();
    first.to_string_lossy().into_owned()
}

/// Returns all members of the main workspace and of the virtual boards' separate workspace.
fn packages() -> Vec<Package> {
    let mut packages = workspace::packages("Cargo.toml").expect("cargo metadata");
    packages.extend(workspace::packages("tests/virtual-board/Cargo.toml").expect("cargo metadata"));
    packages
}

/// Returns every `.rs` file below the folder of a member. Skips `target` and folders with a
/// manifest of their own, which belong to other members.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let is_other = path.file_name().is_some_and(|name| name == "target")
                || path.join("Cargo.toml").exists();
            if path.is_dir() && !is_other {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    files
}
