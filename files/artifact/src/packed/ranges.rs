//! Checks that no sum in the packed code's integer encoder can overflow.

use super::file::{DESCRIPTION, SYNTHESIS, TENSORS};
use super::model::PackedModel;
use crate::description::Description;
use crate::error::{ArtifactError, TensorProblem};
use packed::{LEVELS, MAX_COEFFICIENTS, Tables};

/// Largest permitted magnitude of a sum of products. The kernels compute `256 * sum + other sum` in
/// one 32-bit register, so each sum must fit 24 bits.
pub const SUM_LIMIT: i64 = (1 << 23) - 1;

/// Largest magnitude that [`rounded_state`](super::rounded_state) returns.
pub const LARGEST_STATE: i16 = 4096;

/// Number of inputs that the encoder's matrix kernel takes at a time.
pub const INPUTS_PER_ROUND: usize = 16;

/// Returns, for each step of a block, how many inputs of the block the encoder has multiplied after
/// that step: all complete rounds of 16 inputs, and after the last step all inputs.
pub fn slice_ends(electrodes: usize, steps: usize) -> Vec<usize> {
    let ends = (1..steps).map(|steps| steps * electrodes / INPUTS_PER_ROUND * INPUTS_PER_ROUND);
    ends.chain([steps * electrodes]).collect()
}

/// Checks a packed model. The error names the first part that does not fit the description or whose
/// sums could overflow.
pub(crate) fn check(model: &PackedModel, description: &Description) -> Result<(), ArtifactError> {
    let electrodes = description.montage.electrodes.len();
    let steps = description.window.hop;
    let values = electrodes * steps;
    check_description(model, values)?;
    check_shapes(model, values)?;
    let count = model.coefficients();
    let slices = slice_ends(electrodes, steps);
    let limit = model.description.input_limit.into();
    check_matrix("analysis", &model.analysis.weights, values, &slices, limit)?;
    let whole = [count];
    let limit = LARGEST_STATE.into();
    check_matrix("prediction", &model.prediction.weights, count, &whole, limit)?;
    for (name, matrix) in [("analysis", &model.analysis), ("prediction", &model.prediction)] {
        let is_outside = |factor: &i32| *factor < 0 || *factor == i32::MAX;
        if let Some(output) = matrix.factors.iter().position(is_outside) {
            return Err(range(name, output, "the factor is negative, or 1/2 or more"));
        }
    }
    let levels = model.predicted_levels.iter().chain(&model.reset_levels);
    if let Some(index) = levels.clone().position(|&level| usize::from(level) >= LEVELS) {
        return Err(range("levels", index, "the level is above 63"));
    }
    let costs = model.costs();
    let tables = Tables { starts: &model.starts, costs: &costs };
    if !tables.is_consistent() {
        return Err(range(
            "starts",
            0,
            "a magnitude has no frequency, or the frequencies do not ascend",
        ));
    }
    let synthesis = model.synthesis.as_deref().unwrap_or_default();
    for (name, floats) in [("smoother.scale", &*model.smoother.scales), (SYNTHESIS, synthesis)] {
        if let Some(index) = floats.iter().position(|float| !float.is_finite()) {
            return Err(range(name, index, "it is not finite"));
        }
    }
    match (&model.description.weight, &model.synthesis) {
        (Some(_), None) => Err(TensorProblem::Missing.of(TENSORS, SYNTHESIS)),
        (None, Some(_)) => Err(TensorProblem::Unknown.of(TENSORS, SYNTHESIS)),
        _ => Ok(()),
    }
}

fn check_description(model: &PackedModel, values: usize) -> Result<(), ArtifactError> {
    let description = &model.description;
    let field = |field, found: &dyn std::fmt::Display, expected: String| {
        Err(ArtifactError::Field { file: DESCRIPTION, field, found: found.to_string(), expected })
    };
    let count = description.coefficients;
    if description.format != 1 {
        return field("format", &description.format, "1".to_owned());
    }
    if count == 0 || !count.is_multiple_of(INPUTS_PER_ROUND) || count > MAX_COEFFICIENTS.min(values)
    {
        let most = MAX_COEFFICIENTS.min(values) / INPUTS_PER_ROUND * INPUTS_PER_ROUND;
        return field("coefficients", &count, format!("a multiple of 16 up to {most}"));
    }
    if description.rate > 15 {
        return field("rate", &description.rate, "0 to 15".to_owned());
    }
    if description.input_limit < 127 {
        let expected = "127 to 32767".to_owned();
        return field("input_limit", &description.input_limit, expected);
    }
    for (name, value) in [("unit_uv", description.unit_uv), ("misfit_uv2", description.misfit_uv2)]
    {
        if !(value.is_finite() && value > 0.0) {
            return field(name, &value, "above 0".to_owned());
        }
    }
    let largest_uv2 = (f64::from(description.input_limit) * description.unit_uv).powi(2);
    if description.misfit_uv2 > largest_uv2 {
        let expected = format!("at most {largest_uv2}, the square of the largest input value");
        return field("misfit_uv2", &description.misfit_uv2, expected);
    }
    if let Some(weight) = &description.weight {
        let [low, high] = weight.band_hz;
        if !(1.0 <= low && low < high && high <= 60.0) {
            let expected = "two ascending frequencies within 1 to 60 Hz".to_owned();
            return field("weight.band_hz", &format!("{low}, {high}"), expected);
        }
        if !(weight.strength.is_finite() && weight.strength > 0.0) {
            return field("weight.strength", &weight.strength, "above 0".to_owned());
        }
    }
    Ok(())
}

/// Checks the lengths of all tensors, for models built in memory; files have passed this check
/// already.
fn check_shapes(model: &PackedModel, values: usize) -> Result<(), ArtifactError> {
    for (name, kind, shape, bytes) in model.tensors(values) {
        let length = bytes.len() / (kind.bitsize() / 8);
        if length != shape.iter().product::<usize>() {
            return Err(TensorProblem::Shape(vec![length], shape).of(TENSORS, name));
        }
    }
    Ok(())
}

/// Checks that each slice of products sums to at most [`SUM_LIMIT`] when all inputs have the
/// magnitude `limit`.
fn check_matrix(
    name: &'static str,
    weights: &[i8],
    inputs: usize,
    slices: &[usize],
    limit: i64,
) -> Result<(), ArtifactError> {
    for (output, weights) in weights.chunks_exact(inputs).enumerate() {
        if weights.contains(&i8::MIN) {
            return Err(range(name, output, "a weight is -128"));
        }
        let mut start = 0;
        for &end in slices {
            let sum = weights[start..end].iter().map(|&w| i64::from(w).abs()).sum::<i64>();
            if sum * limit > SUM_LIMIT {
                return Err(range(name, output, "a sum of products could exceed 23 bits"));
            }
            start = end;
        }
    }
    Ok(())
}

fn range(name: &str, index: usize, problem: &'static str) -> ArtifactError {
    TensorProblem::Range(index, problem).of(TENSORS, name)
}
