//! Turns a trained artifact into Rust constants for the device: designs the filters, quantises the
//! encoder, proves that no value leaves its range, and writes the source files.
//!
//! `signal/model/build.rs` calls [`generate`]. The trainer uses [`quantise`] for the golden codes
//! and the int8 figures, and [`filter_cascade`] for the filters of its training data.
//!
//! ```text
//!             [filters] --> cascade, ResamplerTable --> headroom: no overflow
//! Artifact --<                                                                 |
//!             weights, calibration --> quantise --> IntegerModel --> pack      |
//!                                                                     |        |
//!             constants.rs, statics.rs, manifest.txt <-------- DeviceModel <--+
//! ```
//!
//! ```
//! use artifact::Artifact;
//! use model_gen::{DeviceModel, manifest};
//! use std::path::Path;
//!
//! let artifact = Artifact::read(Path::new("../signal/model/artifact"))?;
//! let model = DeviceModel::new(&artifact)?;
//! // The largest gain to any node of the filters, for full-scale input, stays below 8.
//! let gains = model.filters.iter().flat_map(|filter| &filter.gains);
//! assert!(gains.map(|node| node.gain).fold(0.0, f64::max) < 8.0);
//! assert!(manifest(&model).starts_with("model id"));
//! # Ok::<(), model_gen::ModelGenError>(())
//! ```
#![forbid(unsafe_code)]

mod cascade;
mod chain;
mod device_model;
mod emit;
mod error;
pub mod front_end;
pub mod headroom;
mod integer_model;
mod layer;
mod manifest;
pub mod memory;
pub mod pack;
mod packed;
mod quantise;
pub mod resampler;
pub mod response;
mod upload;

use std::path::Path;

pub use cascade::{FilterSpec, band_power_sections, butterworth_band_pass, cascade, notch};
pub use chain::Chain;
pub use device_model::{
    DeviceModel, MAINS_HZ, MainsFilter, filter_cascade, group_delay_us, settling_samples,
};
pub use emit::rust_files;
pub use error::{FilterError, ModelGenError};
pub use integer_model::{IntegerLayer, IntegerModel, integer_code};
pub use manifest::manifest;
pub use packed::PackedIntegers;
pub use quantise::quantise;
pub use resampler::ResamplerTable;
pub use upload::upload;

/// Reads the artifact in `artifact_dir` and writes to `out_dir` the [`rust_files`], `manifest.txt`,
/// and `artifact_files.rs`, which embeds the artifact's files in a program.
///
/// # Errors
/// If the artifact cannot be read or turned into integers, or a file cannot be written.
pub fn generate(artifact_dir: &Path, out_dir: &Path) -> Result<(), ModelGenError> {
    let model = DeviceModel::new(&artifact::Artifact::read(artifact_dir)?)?;
    let files = rust_files(&model).into_iter();
    let others = [
        ("manifest.txt", manifest(&model)),
        ("artifact_files.rs", artifact::embedding(artifact_dir)),
    ];
    for (name, text) in files.chain(others) {
        let path = out_dir.join(name);
        std::fs::write(&path, text).map_err(|source| ModelGenError::Write { path, source })?;
    }
    Ok(())
}
