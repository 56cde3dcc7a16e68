//! Turns a trained artifact into Rust integers: filter design, quantisation, range proofs, code.
//!
//! `model/build.rs` calls [`generate`]; the trainer uses [`quantise`] for the golden codes and for
//! the int8 figures, and [`filter_cascade`] for the front end that its training data passes.
#![forbid(unsafe_code)]

mod cascade;
mod chain;
mod conv_kernel;
pub mod design;
mod device_model;
mod emit;
mod error;
pub mod fir;
pub mod headroom;
mod integer_code;
mod integer_model;
mod manifest;
pub mod memory;
pub mod pack;
mod quantise;
pub mod resampler;
pub mod response;
mod rounding;
mod rows;

use std::path::Path;

pub use cascade::{FilterSpec, cascade};
pub use chain::Chain;
pub use conv_kernel::ConvKernel;
pub use device_model::{DeviceModel, MAINS_HZ, MainsFilter, filter_cascade};
pub use emit::rust;
pub use error::{FilterError, ModelGenError};
pub use integer_code::integer_code;
pub use integer_model::{
    CELLS, CODE, ELECTRODES, IntegerConv, IntegerLinear, IntegerModel, Plane, STEPS,
};
pub use manifest::manifest;
pub use quantise::quantise;
pub use resampler::ResamplerTable;

/// Reads the artifact in `artifact_dir` and writes `generated.rs` and `manifest.txt` to `out_dir`.
///
/// # Errors
/// When the artifact cannot be read, cannot be turned into integers, or the files not be written.
pub fn generate(artifact_dir: &Path, out_dir: &Path) -> Result<(), ModelGenError> {
    let model = DeviceModel::new(&artifact::Artifact::read(artifact_dir)?)?;
    for (name, text) in [
        ("generated.rs", rust(&model)),
        ("manifest.txt", manifest(&model)),
    ] {
        let path = out_dir.join(name);
        std::fs::write(&path, text).map_err(|source| ModelGenError::Write { path, source })?;
    }
    Ok(())
}
