//! A packed model as the bytes that a host uploads to a device.

use artifact::Artifact;
use int8_nn::Pair;

use crate::error::ModelGenError;
use crate::packed::PackedIntegers;

/// Version of the layout.
const LAYOUT: u32 = 1;

/// Returns the packed model of an artifact in the layout of an upload (`docs/wire-format.md`), with
/// the weights as the device's matrix kernel reads them; `None` if the artifact has no packed
/// model.
///
/// # Errors
/// If a factor of the model does not fit the device's integers.
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
    bytes.extend([0; 4]);
    let analysis = packed.analysis().into_iter().flat_map(|(_, pairs)| pairs);
    for Pair(pair) in analysis.chain(packed.prediction()) {
        bytes.extend(pair.to_le_bytes());
    }
    for factor in model
        .analysis
        .factors
        .iter()
        .chain(&model.prediction.factors)
    {
        bytes.extend(factor.to_le_bytes());
    }
    for start in model.starts.as_flattened().as_flattened() {
        bytes.extend(start.to_le_bytes());
    }
    bytes.extend(model.costs().as_flattened().as_flattened());
    bytes.extend(&model.predicted_levels);
    bytes.extend(&model.reset_levels);
    Ok(Some(bytes))
}
