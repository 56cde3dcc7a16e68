//! A model as the bytes that a host uploads to a device.

use artifact::{Artifact, CodeFormat, Mode};
use int8_nn::Pair;

use crate::device_model::input_multiplier;
use crate::error::ModelGenError;
use crate::pack;
use crate::packed::PackedIntegers;
use crate::quantise::quantise;

/// Version of the upload's layout, stored in the first four bytes.
const LAYOUT: u32 = 2;

/// Returns the packed model of an artifact in the layout of an upload (`docs/wire-format.md`), with
/// the weights in the order of the device's matrix kernel. If the network is linear (mode `pca`),
/// its code follows. `None` if the artifact has no packed model.
///
/// # Errors
/// If a factor does not fit the device's integers, or a sum could overflow them.
pub fn upload(artifact: &Artifact) -> Result<Option<Vec<u8>>, ModelGenError> {
    let Some(model) = &artifact.packed else {
        return Ok(None);
    };
    let description = &artifact.description;
    let packed = PackedIntegers::new(model, description)?;
    let shape = [
        description.montage.electrodes.len(),
        description.window.hop,
        packed.input_pairs(),
        model.coefficients(),
    ];
    let mut bytes = Vec::new();
    bytes.extend(LAYOUT.to_le_bytes());
    for number in shape {
        bytes.extend(u16::try_from(number).unwrap_or(u16::MAX).to_le_bytes());
    }
    bytes.extend(artifact.network_id()?.0);
    bytes.extend(packed.input_multiplier.to_le_bytes());
    bytes.extend(packed.misfit_energy.to_le_bytes());
    bytes.extend(i32::from(model.description.input_limit).to_le_bytes());
    let has_linear = description.mode == Mode::Pca;
    bytes.extend(u32::from(has_linear).to_le_bytes());
    let analysis = packed.analysis().into_iter().flat_map(|(_, pairs)| pairs);
    for Pair(pair) in analysis.chain(packed.prediction()) {
        bytes.extend(pair.to_le_bytes());
    }
    for factor in model.analysis.factors.iter().chain(&model.prediction.factors) {
        bytes.extend(factor.to_le_bytes());
    }
    for start in model.starts.as_flattened().as_flattened() {
        bytes.extend(start.to_le_bytes());
    }
    bytes.extend(model.costs().as_flattened().as_flattened());
    bytes.extend(&model.predicted_levels);
    bytes.extend(&model.reset_levels);
    if has_linear {
        linear_code(artifact, &mut bytes)?;
    }
    Ok(Some(bytes))
}

/// Appends the linear code of an artifact of mode `pca`.
fn linear_code(artifact: &Artifact, bytes: &mut Vec<u8>) -> Result<(), ModelGenError> {
    let integers = quantise(artifact)?;
    let dimensions = integers.geometry.dimensions;
    let format = match integers.code_format {
        CodeFormat::Int8 => 0,
        CodeFormat::Int8Exponent => 1,
        CodeFormat::Int16 => 2,
    };
    let pairs = pack::electrode_pairs(dimensions.electrodes);
    for number in [dimensions.steps, pairs, dimensions.numbers, format] {
        bytes.extend(u16::try_from(number).unwrap_or(u16::MAX).to_le_bytes());
    }
    let multiplier = input_multiplier(&artifact.description, &integers)?;
    bytes.extend(multiplier.to_le_bytes());
    for scale in &integers.code_scale {
        bytes.extend(scale.to_le_bytes());
    }
    for zero_point in &integers.code_zero_point {
        bytes.extend(zero_point.to_le_bytes());
    }
    for multiplier in &integers.shortcut.multipliers {
        bytes.extend(multiplier.to_le_bytes());
    }
    for Pair(pair) in pack::shortcut(&integers).into_iter().flatten() {
        bytes.extend(pair.to_le_bytes());
    }
    Ok(())
}
