//! Checked-in data of the reports: published figures of others, and memory of microcontrollers.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::failure::Failure;

/// Figures of another library's filters; `bench/published.toml` states the conditions.
#[derive(Debug, Clone, Deserialize, Serialize)]
pub(crate) struct PublishedFilters {
    /// Library and function.
    pub(crate) name: String,
    /// Fewest and most.
    pub(crate) insn_per_sample_channel: [u32; 2],
    /// In-band noise with its unit.
    pub(crate) noise: String,
}

/// Figures of another implementation of the encoder's layers; `bench/published.toml` states the conditions.
#[derive(Debug, Clone, Deserialize, Serialize)]
pub(crate) struct PublishedEncoder {
    pub(crate) name: String,
    pub(crate) insn_per_code: u32,
}

#[derive(Debug, Deserialize)]
pub(crate) struct Published {
    pub(crate) filters: Vec<PublishedFilters>,
    pub(crate) encoder: Vec<PublishedEncoder>,
}

/// Memory of a microcontroller, KiB of 1024 bytes.
#[derive(Debug, Deserialize)]
pub(crate) struct Part {
    pub(crate) name: String,
    pub(crate) flash_kib: i64,
    pub(crate) ram_kib: i64,
    /// Memory that holds a program's variables and stack.
    pub(crate) region: String,
}

#[derive(Debug, Deserialize)]
struct Parts {
    part: Vec<Part>,
}

/// Reads `bench/published.toml`.
pub(crate) fn published() -> Result<Published, Failure> {
    parse("published.toml", include_str!("../../published.toml"))
}

/// Reads `bench/parts.toml`.
pub(crate) fn parts() -> Result<Vec<Part>, Failure> {
    let parts: Parts = parse("parts.toml", include_str!("../../parts.toml"))?;
    Ok(parts.part)
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
