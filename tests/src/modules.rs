//! Module tree of a crate: which module each file is, and which other files it names.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Attribute, File, Item, ItemMod, ItemUse, Meta, UseTree};

/// Name of a module, from the crate's root: `["link", "decoder"]`. Empty for the root itself.
type ModulePath = Vec<String>;

/// The module tree cannot be read, because of one of its source files.
#[derive(Debug, thiserror::Error)]
pub enum ModulesError {
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    Read {
        /// File that cannot be read.
        path: PathBuf,
        /// Reason given by the operating system.
        error: std::io::Error,
    },
    /// The file is not Rust of the edition that `syn` parses.
    #[error("{}: {error}; does `rustc` accept this file?", path.display())]
    Parse {
        /// File that cannot be parsed.
        path: PathBuf,
        /// Reason given by the parser.
        error: syn::Error,
    },
    /// A declaration `mod name;` has no file.
    #[error("{}: `mod {name};` has no file", path.display())]
    NoFile {
        /// File that contains the declaration.
        path: PathBuf,
        /// Name of the declared module.
        name: String,
    },
}

/// All files that one crate root declares, and which of them use which.
#[derive(Debug, Default)]
pub struct Modules {
    /// Files of each module. A module has several files if `#[cfg]` chooses between them.
    files: BTreeMap<ModulePath, BTreeSet<PathBuf>>,
    uses: BTreeMap<PathBuf, BTreeSet<PathBuf>>,
    test_files: BTreeSet<PathBuf>,
}

impl Modules {
    /// Reads a crate root (`lib.rs`, `main.rs`, a test, an example) and every file that it declares.
    ///
    /// # Errors
    /// A file is missing, unreadable or not Rust.
    pub fn read(root: &Path) -> Result<Self, ModulesError> {
        let mut modules = Self::default();
        let mut parsed = Vec::new();
        let folder = root.parent().unwrap_or(Path::new("."));
        modules.declare(root, folder, Vec::new(), false, &mut parsed)?;
        for (module, path, file) in parsed {
            let mut names = PathsNamed::default();
            names.visit_file(&file);
            let targets = names.paths.iter();
            let targets = targets.filter_map(|named| modules.resolve(&module, named));
            let targets = targets.flatten().filter(|target| **target != path);
            let targets = targets.cloned().collect();
            modules.uses.insert(path, targets);
        }
        Ok(modules)
    }

    /// Returns every file that belongs to the crate, including the files of its unit tests.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.files.values().flatten().chain(&self.test_files)
    }

    /// Returns the groups of files that depend on each other in a circle, through `use` and paths.
    /// Paths in unit tests do not count.
    pub fn circles(&self) -> Vec<BTreeSet<&Path>> {
        let reach: BTreeMap<&Path, BTreeSet<&Path>> = self
            .uses
            .keys()
            .map(|file| (file.as_path(), self.reachable(file)))
            .collect();
        let circle_of = |file: &Path| -> BTreeSet<&Path> {
            let there = reach[file].iter().copied();
            there.filter(|other| reach[other].contains(file)).collect()
        };
        let circles = reach.keys().map(|file| circle_of(file));
        let distinct: BTreeSet<BTreeSet<&Path>> =
            circles.filter(|circle| circle.len() > 1).collect();
        distinct.into_iter().collect()
    }

    fn reachable(&self, file: &Path) -> BTreeSet<&Path> {
        let mut found = BTreeSet::new();
        let mut waiting = vec![file];
        while let Some(next) = waiting.pop() {
            for target in &self.uses[next] {
                if found.insert(target.as_path()) {
                    waiting.push(target);
                }
            }
        }
        found
    }

    /// Adds a file and, recursively, the files of its `mod name;` items.
    fn declare(
        &mut self,
        path: &Path,
        folder: &Path,
        module: ModulePath,
        tests: bool,
        parsed: &mut Vec<(ModulePath, PathBuf, File)>,
    ) -> Result<(), ModulesError> {
        let text = fs::read_to_string(path).map_err(|error| ModulesError::Read {
            path: path.to_owned(),
            error,
        })?;
        let file = syn::parse_file(&text).map_err(|error| ModulesError::Parse {
            path: path.to_owned(),
            error,
        })?;
        for item in &file.items {
            let Item::Mod(item) = item else { continue };
            if item.content.is_some() {
                continue;
            }
            let name = item.ident.to_string();
            let child = module_file(item, &name, path, folder)?;
            let mut child_module = module.clone();
            child_module.push(name.clone());
            let child_folder = folder.join(&name);
            let child_tests = tests || is_test_only(&item.attrs);
            self.declare(&child, &child_folder, child_module, child_tests, parsed)?;
        }
        if tests {
            self.test_files.insert(path.to_owned());
        } else {
            let files = self.files.entry(module.clone()).or_default();
            files.insert(path.to_owned());
            parsed.push((module, path.to_owned(), file));
        }
        Ok(())
    }

    /// Returns the files of the deepest module on a path, or `None` if the path leads to another
    /// crate.
    fn resolve(&self, from: &ModulePath, path: &[String]) -> Option<&BTreeSet<PathBuf>> {
        let mut segments = path.iter();
        let mut module = from.clone();
        match path.first()?.as_str() {
            "crate" => {
                module.clear();
                segments.next();
            }
            "self" => {
                segments.next();
            }
            "super" => {
                for _ in path.iter().take_while(|segment| *segment == "super") {
                    module.pop();
                    segments.next();
                }
            }
            first => {
                let mut child = module.clone();
                child.push(first.to_owned());
                if !self.files.contains_key(&child) {
                    return None;
                }
            }
        }
        for segment in segments {
            module.push(segment.clone());
            if !self.files.contains_key(&module) {
                module.pop();
                break;
            }
        }
        self.files.get(&module)
    }
}

/// Returns the file of `mod name;`: in the folder of its parent module, or at the path in `#[path]`.
fn module_file(
    item: &ItemMod,
    name: &str,
    parent: &Path,
    folder: &Path,
) -> Result<PathBuf, ModulesError> {
    let stated = item.attrs.iter().find_map(|attribute| {
        let Meta::NameValue(pair) = &attribute.meta else {
            return None;
        };
        let syn::Expr::Lit(literal) = &pair.value else {
            return None;
        };
        match &literal.lit {
            syn::Lit::Str(text) if pair.path.is_ident("path") => Some(text.value()),
            _ => None,
        }
    });
    let path = match stated {
        Some(stated) => parent.with_file_name(stated),
        None => folder.join(name).with_extension("rs"),
    };
    if path.is_file() {
        Ok(path)
    } else {
        Err(ModulesError::NoFile {
            path: parent.to_owned(),
            name: name.to_owned(),
        })
    }
}

/// Returns whether an item carries `#[cfg(test)]`.
fn is_test_only(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        Meta::List(list) => list.path.is_ident("cfg") && list.tokens.to_string() == "test",
        _ => false,
    })
}

/// Collects the paths that a file names, except those in unit tests and in arguments of macros.
#[derive(Debug, Default)]
struct PathsNamed {
    paths: Vec<ModulePath>,
    /// Number of inline modules around the visited item. The first `super`s of a path lead out of
    /// these.
    inline: usize,
}

impl PathsNamed {
    fn add_use(&mut self, prefix: &ModulePath, tree: &UseTree) {
        let mut path = prefix.clone();
        match tree {
            UseTree::Path(part) => {
                path.push(part.ident.to_string());
                self.add_use(&path, &part.tree);
            }
            UseTree::Name(name) => {
                path.push(name.ident.to_string());
                self.add(path);
            }
            UseTree::Rename(rename) => {
                path.push(rename.ident.to_string());
                self.add(path);
            }
            UseTree::Glob(_) => self.add(path),
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.add_use(&path, tree);
                }
            }
        }
    }

    fn add(&mut self, mut path: ModulePath) {
        for _ in 0..self.inline {
            if path.first().is_some_and(|segment| segment == "super") {
                path.remove(0);
            }
        }
        self.paths.push(path);
    }
}

impl Visit<'_> for PathsNamed {
    fn visit_item(&mut self, item: &Item) {
        let attributes = match item {
            Item::Mod(item) => &item.attrs,
            Item::Fn(item) => &item.attrs,
            Item::Use(item) => &item.attrs,
            Item::Impl(item) => &item.attrs,
            Item::Const(item) => &item.attrs,
            _ => return visit::visit_item(self, item),
        };
        if !is_test_only(attributes) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &ItemMod) {
        self.inline += 1;
        visit::visit_item_mod(self, item);
        self.inline -= 1;
    }

    // Skip `pub(super)` and `pub(crate)`, because they name no item.
    fn visit_vis_restricted(&mut self, _: &syn::VisRestricted) {}

    fn visit_item_use(&mut self, item: &ItemUse) {
        self.add_use(&Vec::new(), &item.tree);
    }

    fn visit_path(&mut self, path: &syn::Path) {
        // A single name in an expression is a variable or an imported item.
        if path.segments.len() == 1 {
            return visit::visit_path(self, path);
        }
        let segments = path.segments.iter();
        self.add(segments.map(|segment| segment.ident.to_string()).collect());
        visit::visit_path(self, path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes these files, which make up a crate, and returns the crate's root.
    fn crate_of(folder: &Path, files: &[(&str, &str)]) -> PathBuf {
        for (name, text) in files {
            let path = folder.join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a writable folder");
            fs::write(path, text).expect("a writable file");
        }
        folder.join("lib.rs")
    }

    #[test]
    fn two_files_that_use_each_other_are_a_circle() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = crate_of(
            folder.path(),
            &[
                ("lib.rs", "mod a; mod b; mod c;"),
                ("a.rs", "use crate::b::B; pub struct A(B);"),
                ("b.rs", "pub struct B; fn f() { let _ = super::a::g(); }"),
                ("c.rs", "use crate::a::A; pub struct C(A);"),
            ],
        );
        let modules = Modules::read(&root).expect("a crate");
        let names = ["a.rs", "b.rs"].map(|name| folder.path().join(name));
        let circle: BTreeSet<&Path> = names.iter().map(PathBuf::as_path).collect();
        assert_eq!(modules.circles(), [circle]);
    }

    #[test]
    fn an_import_through_the_facade_is_a_circle_and_one_by_module_path_is_none() {
        for (import, circles) in [("use crate::B;", 1), ("use crate::b::B;", 0)] {
            let folder = tempfile::tempdir().expect("a folder");
            let root = crate_of(
                folder.path(),
                &[
                    ("lib.rs", "mod a; mod b; pub use a::A; pub use b::B;"),
                    ("a.rs", &format!("{import} pub struct A(B);")),
                    ("b.rs", "pub struct B;"),
                ],
            );
            let modules = Modules::read(&root).expect("a crate");
            assert_eq!(modules.circles().len(), circles, "{import}");
        }
    }

    #[test]
    fn unit_tests_belong_to_the_crate_and_make_no_circle() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = crate_of(
            folder.path(),
            &[
                ("lib.rs", "mod a; pub use a::A;"),
                (
                    "a.rs",
                    "pub struct A; #[cfg(test)] mod tests; #[cfg(test)] fn t() { crate::A; }",
                ),
                ("a/tests.rs", "use super::A; use crate::A as B;"),
            ],
        );
        let modules = Modules::read(&root).expect("a crate");
        assert!(modules.circles().is_empty());
        assert!(modules.files().any(|file| file.ends_with("a/tests.rs")));
    }

    #[test]
    fn a_declaration_without_a_file_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = crate_of(folder.path(), &[("lib.rs", "mod missing;")]);
        let error = Modules::read(&root).expect_err("there is no such file");
        assert!(error.to_string().contains("`mod missing;`"), "{error}");
    }
}
