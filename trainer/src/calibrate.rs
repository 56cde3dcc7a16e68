//! Calibration: measures the value ranges from which model-gen derives the int8 scales.

use crate::dataset::Dataset;
use crate::error::TrainerError;
use crate::network::Network;
use crate::parameters::Parameters;
use artifact::{Artifact, Description, Tensors};
use packed_fit::MIN_RANGE;

/// Builds a model from parameters and calibrates it on the windows of `dataset` at every hop. The
/// dataset is in units of the description's `sd_uv`.
///
/// The calibration holds the smallest and largest value of each dimension of the code (at most -10
/// and at least 10), the largest input and the largest activations. model-gen adds head room to
/// these ranges. A channel that never varies is held at its batch norm's bias
/// ([`Parameters::hold_silent_channels`]).
///
/// # Errors
/// If description and parameters are not a valid model.
pub(crate) fn calibrated_artifact(
    mut description: Description,
    parameters: &Parameters,
    dataset: &Dataset,
) -> Result<Artifact, TrainerError> {
    description.mode = parameters.mode();
    artifact::check_description(&description)?;
    let mut parameters = parameters.clone();
    parameters.hold_silent_channels();
    let windows = dataset.aligned(description.window.hop);
    let trace = Network::new(&description).trace(&parameters, &windows);
    let numbers = description.code.numbers;
    let (mut low, mut high) = (vec![-MIN_RANGE; numbers], vec![MIN_RANGE; numbers]);
    for code in trace.codes.chunks_exact(numbers) {
        for ((low, high), z) in low.iter_mut().zip(&mut high).zip(code) {
            *low = low.min(*z);
            *high = high.max(*z);
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "calibration is f32")]
    let largest_uv = (f64::from(dataset.max_abs()) * description.input.sd_uv) as f32;
    let mut calibration = Tensors::for_calibration();
    calibration.insert("input.max_abs", &[1], vec![largest_uv]);
    calibration.insert("code.min", &[numbers], low);
    calibration.insert("code.max", &[numbers], high);
    if description.mode.has_convolutions() {
        let [first, second] = trace.activations;
        calibration.insert("activation1.max", &[1], vec![first]);
        calibration.insert("activation2.max", &[1], vec![second]);
    }
    Ok(Artifact::new(description, parameters.to_tensors(), calibration)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    /// Returns the calibration tensor `name`: one end of the range of each code value.
    fn range<'a>(artifact: &'a Artifact, name: &str) -> &'a [f32] {
        let numbers = artifact.description.code.numbers;
        artifact.calibration.tensor(name, &[numbers]).unwrap()
    }

    #[test]
    fn the_ranges_are_those_of_the_codes_and_the_input() {
        let mut dataset = testing::dataset(3, 128);
        dataset.scale(20.0);
        let parameters = testing::pca();
        let artifact = testing::model(&parameters, &dataset);
        // Each direction of the test's PCA selects one feature, so the range of a code dimension is
        // the range of its feature.
        let feature = testing::feature(5);
        let windows = dataset.aligned(8);
        let values = || windows.iter().map(|window| window[feature]);
        for (name, end) in [
            ("code.min", values().fold(f32::INFINITY, f32::min)),
            ("code.max", values().fold(f32::NEG_INFINITY, f32::max)),
        ] {
            assert!((range(&artifact, name)[5] - end).abs() < 1e-6, "{name}");
        }
        let uv = artifact.calibration.tensor("input.max_abs", &[1]).unwrap()[0];
        assert!((f64::from(uv) - f64::from(dataset.max_abs()) * 47.3).abs() < 1e-3);
    }

    #[test]
    fn a_dimension_without_energy_has_the_minimum_range() {
        let dataset = testing::dataset(3, 64);
        let parameters = testing::pca();
        let artifact = testing::model(&parameters, &dataset);
        for (name, reach) in [("code.min", -MIN_RANGE), ("code.max", MIN_RANGE)] {
            let mut values = range(&artifact, name).iter();
            assert!(values.all(|value| (value - reach).abs() < f32::EPSILON), "{name}");
        }
    }
}
