//! What the program `model-gen` does with models: show, compare, check and import them.
//!
//! ```text
//! artifact ------------------> show, difference, check --> text or JSON
//! state_dict, description --> import --> artifact
//! ```
//!
//! The library `model-gen` turns artifacts into integers when the firmware is built; this crate is for people.
//! docs/importing.md is the guide to the import.
#![forbid(unsafe_code)]

pub mod check;
pub mod difference;
mod error;
pub mod import;
pub mod show;

pub use error::ToolError;
