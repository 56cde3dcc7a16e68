//! Names of a packed model's files.

/// Name of the file with dimensions, units and figures.
pub(crate) const DESCRIPTION: &str = "packed.toml";

/// Name of the file with the integers.
pub(crate) const TENSORS: &str = "packed.safetensors";
