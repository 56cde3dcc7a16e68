//! Checked-in data: the model's artifact, published figures of others, and memory of microcontrollers.

use std::collections::BTreeMap;
use std::path::Path;

use artifact::Artifact;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

use super::failure::Failure;

/// Folder of the built-in model.
pub(crate) const ARTIFACT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../model/artifact");

/// Memory of a microcontroller, KiB of 1024 bytes.
#[derive(Debug, Deserialize)]
pub(crate) struct Part {
    pub(crate) name: String,
    pub(crate) flash_kib: i64,
    pub(crate) ram_kib: i64,
    /// Name of the memory region that holds a program's variables and stack.
    pub(crate) region: String,
}

/// Reads the built-in model's artifact.
///
/// # Errors
/// A file is missing or malformed.
pub(crate) fn artifact() -> Result<Artifact, Failure> {
    Artifact::read(Path::new(ARTIFACT)).map_err(|error| {
        let next = "`git status model/artifact`";
        Failure::new("reading the model's artifact", error, next)
    })
}

/// Reads the figures of other libraries for one benchmark from `bench/published.toml`.
pub(crate) fn published(benchmark: &str) -> Result<Json, Failure> {
    let text = include_str!("../../published.toml");
    let mut tables: BTreeMap<String, Json> = parse("published.toml", text)?;
    Ok(tables.remove(benchmark).unwrap_or_default())
}

/// Reads the flash and RAM sizes of microcontrollers from `bench/parts.toml`.
pub(crate) fn parts() -> Result<Vec<Part>, Failure> {
    let text = include_str!("../../parts.toml");
    let mut parts: BTreeMap<String, Vec<Part>> = parse("parts.toml", text)?;
    Ok(parts.remove("part").unwrap_or_default())
}

/// Parses a TOML file of this crate.
///
/// # Errors
/// The file does not have the fields of `T`.
pub(crate) fn parse<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, Failure> {
    toml::from_str(text).map_err(|error| {
        let what = format!("reading bench/{name}");
        Failure::new(what, error, format!("compare with `git diff bench/{name}`"))
    })
}
