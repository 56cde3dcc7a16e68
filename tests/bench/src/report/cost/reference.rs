//! Inputs of the image `encoder` for any model, with their codes from model-gen's batch reference.

use any_model::Stress;
use artifact::{Artifact, CodeFormat, IntegerCode};

use crate::report::encoder::Expected;

/// Seed of the windows of smooth EEG; it differs from the seeds of the models.
const SMOOTH: u32 = 0x5eed;

/// Inputs of equal length, and the codes that are expected for them.
#[derive(Debug)]
pub(super) struct Reference {
    pub(super) expected: Expected,
    /// Number of codes over all inputs.
    pub(super) windows: usize,
    /// Number of time steps from the start of one window to the start of the next.
    pub(super) hop: usize,
}

impl Reference {
    /// Makes inputs with at least `windows` windows in all, and encodes each window by itself.
    ///
    /// # Errors
    /// The model's ranges do not fit its integers.
    pub(super) fn new(artifact: &Artifact, windows: usize) -> anyhow::Result<Self> {
        let integers = model_gen::quantise(artifact)?;
        let dimensions = artifact.description.dimensions();
        let (length, hop) = (dimensions.steps, artifact.description.window.hop);
        // At least three windows of each input: the image counts instructions from the third window
        // on, because the encoder's buffers fill before it.
        let windows = windows.div_ceil(Stress::ALL.len() + 1).max(3);
        let steps = length + hop * (windows - 1);
        let mut inputs: Vec<Vec<Vec<i8>>> = Vec::new();
        for stress in Stress::ALL {
            inputs.push(stress.planes(dimensions.cells()).take(steps).collect());
        }
        let smooth = any_model::windows(SMOOTH, artifact, steps.div_ceil(length));
        let smooth: Vec<i8> = smooth
            .iter()
            .flat_map(|window| any_model::quantised(artifact, &integers, window))
            .collect();
        let planes = smooth.chunks_exact(dimensions.cells()).map(<[i8]>::to_vec);
        inputs.push(planes.take(steps).collect());

        let format = artifact.description.code.format;
        let windows_of = |planes: &Vec<Vec<i8>>| -> Vec<Vec<u8>> {
            let windows = planes.windows(length).step_by(hop);
            let code =
                |window: &[Vec<i8>]| to_bytes(format, &integers.encode_window(&window.concat()));
            windows.map(code).collect()
        };
        let codes: Vec<Vec<u8>> = inputs.iter().flat_map(windows_of).collect();
        let code_bytes = codes.first().map_or(1, Vec::len);
        let cells = inputs.iter().flatten().flatten().copied();
        Ok(Self {
            expected: Expected::new(steps, cells, codes.concat(), code_bytes),
            windows: codes.len(),
            hop,
        })
    }
}

/// Returns a code's bytes as the pipeline serialises them: the exponent, if the format has one,
/// then the values, little-endian.
fn to_bytes(format: CodeFormat, code: &IntegerCode) -> Vec<u8> {
    let values = code.values.iter().flat_map(|value| value.to_le_bytes());
    match format {
        CodeFormat::Int16 => values.collect(),
        // A value that fits 8 bits is sent as its lower byte.
        CodeFormat::Int8 => values.step_by(2).collect(),
        CodeFormat::Int8Exponent => [code.exponent].into_iter().chain(values.step_by(2)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::checked_in;

    #[test]
    fn the_reference_s_codes_are_those_of_this_pc_s_pipeline() {
        let artifact = checked_in::artifact().expect("the built-in model");
        let reference = Reference::new(&artifact, 15).expect("codes");
        assert_eq!(reference.windows, 3 * (Stress::ALL.len() + 1));
        reference.expected.assert_codes_of_pipeline(reference.windows);
    }

    #[test]
    fn every_format_has_its_own_bytes() {
        let code = IntegerCode { exponent: 3, values: vec![-2, 5] };
        let bytes = |format| to_bytes(format, &code);
        assert_eq!(bytes(CodeFormat::Int8), [254, 5]);
        assert_eq!(bytes(CodeFormat::Int8Exponent), [3, 254, 5]);
        assert_eq!(bytes(CodeFormat::Int16), [254, 255, 5, 0]);
    }
}
