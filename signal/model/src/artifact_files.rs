//! The files of the trained model from which this crate was generated, for programs on a PC that
//! decode codes. A program that does not use them does not contain them.

/// Text of `model.toml`, the description of the model.
pub const MODEL_TOML: &str = include_str!(concat!(env!("ARTIFACT_FOLDER"), "/model.toml"));
/// Bytes of `weights.safetensors`; none if the model has no network.
pub const WEIGHTS: &[u8] = include_bytes!(env!("WEIGHTS"));
/// Bytes of `calibration.safetensors`.
pub const CALIBRATION: &[u8] =
    include_bytes!(concat!(env!("ARTIFACT_FOLDER"), "/calibration.safetensors"));

/// Text of `packed.toml` and bytes of `packed.safetensors`; `None` if the model has no packed code.
pub const PACKED: Option<(&str, &[u8])> = {
    let toml = include_str!(env!("PACKED_TOML"));
    if toml.is_empty() {
        None
    } else {
        Some((toml, include_bytes!(env!("PACKED_TENSORS"))))
    }
};
