//! Reads checked-in data: the built-in model's artifact and the TOML files of this crate.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use artifact::Artifact;
use serde::de::DeserializeOwned;

/// Folder of the built-in model's artifact: the checked-in one, or the one that
/// `CORTICODE_ARTIFACT` named when this program was built.
pub(crate) const ARTIFACT: &str = match option_env!("CORTICODE_ARTIFACT") {
    Some(folder) => folder,
    None => concat!(env!("CARGO_MANIFEST_DIR"), "/../../signal/model/artifact"),
};

/// Reads the built-in model's artifact.
///
/// # Errors
/// A file is missing or malformed.
pub(crate) fn artifact() -> anyhow::Result<Artifact> {
    let failed = "reading the model's artifact failed\n  next: is the folder in which it was when this program was built still there?";
    Artifact::read(Path::new(ARTIFACT)).context(failed)
}

/// Returns the table `name` in `text`, the contents of `tests/bench/FILE`.
///
/// # Errors
/// `text` is no TOML, has no such table, or a table does not have the fields of `T`.
pub(crate) fn table<T: DeserializeOwned>(file: &str, text: &str, name: &str) -> anyhow::Result<T> {
    let tables: Result<BTreeMap<String, T>, _> = toml::from_str(text);
    let table = tables.map_err(anyhow::Error::from).and_then(|mut tables| {
        let missing = || format!("it has no table {name}");
        tables.remove(name).with_context(missing)
    });
    table.with_context(|| {
        format!(
            "reading tests/bench/{file} failed\n  next: compare with `git diff tests/bench/{file}`"
        )
    })
}
