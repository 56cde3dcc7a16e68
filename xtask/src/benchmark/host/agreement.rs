//! Whether the contenders compute the same codes.

use std::fs;
use std::path::Path;

use artifact::FloatEncoder;
use model::{CODE, CODE_SCALE, CODE_ZERO_POINT};
use serde::Serialize;

use super::super::cannot_write;
use super::super::inputs::unusable;
use super::inputs::Inputs;
use crate::failure::Failure;

/// Windows of which the reference in floats makes codes; it takes its time.
const COMPARED: usize = 32;
/// Most that PyTorch's codes may differ from the reference's, of the largest value: sums of 1,152 and
/// 976 products in another order, f32. Measured 5e-7.
const TORCH_TOLERANCE: f64 = 1e-5;
/// Most rms difference of int8 codes from the reference, in steps of a code. Measured 1.96; rounding
/// alone gives 0.29, the int8 input and the int8 weights the rest.
const INT8_TOLERANCE: f64 = 4.0;

/// How far the contenders' codes are apart.
#[derive(Debug, Clone, Copy, Serialize)]
pub(crate) struct Agreement {
    /// Rms difference of the int8 codes from the reference in floats, in steps of a code.
    pub(crate) int8_rms_steps: f64,
    /// Largest difference of PyTorch's codes from the same, of the largest value.
    pub(crate) torch_relative: Option<f64>,
}

impl Agreement {
    /// Reads the codes that the contenders wrote in `folder`.
    ///
    /// # Errors
    /// A file is missing or has another length.
    pub(crate) fn of(inputs: &Inputs, folder: &Path, with_torch: bool) -> Result<Self, Failure> {
        let encoder = FloatEncoder::new(&inputs.artifact).map_err(unusable)?;
        let windows = inputs.windows.iter().take(COMPARED);
        let reference: Vec<[f32; CODE]> = windows.map(|window| encoder.encode(window)).collect();
        let read = |name: &str, bytes: usize| -> Result<Vec<u8>, Failure> {
            let path = folder.join(name);
            let codes = fs::read(&path).map_err(|error| cannot_write(&path, &error))?;
            if codes.len() == inputs.windows.len() * CODE * bytes {
                Ok(codes)
            } else {
                Err(unusable(format!(
                    "{} has {} bytes",
                    path.display(),
                    codes.len()
                )))
            }
        };
        let int8 = read(bench::host::CODES, size_of::<i32>())?;
        let torch = with_torch.then(|| read("torch.bin", size_of::<f32>()));
        Ok(Self {
            int8_rms_steps: rms_steps(&int8, &reference),
            torch_relative: torch.transpose()?.map(|codes| relative(&codes, &reference)),
        })
    }

    /// What is too far apart; a distance that is no number is.
    pub(crate) fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let steps = self.int8_rms_steps;
        if steps.is_nan() || steps > INT8_TOLERANCE {
            faults.push(format!(
                "the int8 codes are {steps:.2} steps (rms) from the reference, {INT8_TOLERANCE} allowed"
            ));
        }
        if let Some(distance) = self.torch_relative
            && (distance.is_nan() || distance > TORCH_TOLERANCE)
        {
            faults.push(format!(
                "PyTorch's codes are {distance:.1e} from the reference, {TORCH_TOLERANCE:e} allowed"
            ));
        }
        faults
    }
}

/// Codes in steps of 32 bits, little endian. Where a code in floats is beyond the range of int8, its
/// end is the reference.
fn rms_steps(codes: &[u8], reference: &[[f32; CODE]]) -> f64 {
    let mut sum = 0.0;
    let codes = codes.as_chunks().0.chunks_exact(CODE);
    for (codes, reference) in codes.zip(reference) {
        for (dimension, (&code, z)) in codes.iter().zip(reference).enumerate() {
            let exact = z / CODE_SCALE[dimension] + f32::from(CODE_ZERO_POINT[dimension]);
            let exact = f64::from(exact.clamp(i8::MIN.into(), i8::MAX.into()));
            sum += (f64::from(i32::from_le_bytes(code)) - exact).powi(2);
        }
    }
    (sum / count(reference)).sqrt()
}

/// Codes of 32-bit floats, little endian.
fn relative(codes: &[u8], reference: &[[f32; CODE]]) -> f64 {
    let codes = codes
        .as_chunks()
        .0
        .iter()
        .map(|&code| f32::from_le_bytes(code));
    let reference = reference.as_flattened();
    let largest = reference
        .iter()
        .fold(0.0_f32, |largest, z| largest.max(z.abs()));
    let differences = codes.zip(reference).map(|(code, z)| (code - z).abs());
    // A code that is no number must not get lost in `max`.
    let most = differences.fold(0.0_f32, |most, difference| {
        let stays = most.is_nan() || difference <= most;
        if stays { most } else { difference }
    });
    f64::from(most) / f64::from(largest)
}

#[expect(clippy::cast_precision_loss, reason = "a few thousand")]
fn count(reference: &[[f32; CODE]]) -> f64 {
    reference.as_flattened().len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A code in floats whose int8 is 3 above each zero point.
    fn exact() -> [f32; CODE] {
        CODE_SCALE.map(|scale| 3.0 * scale)
    }

    #[test]
    fn a_code_in_the_wrong_order_is_far_apart() {
        let codes = |above: i32| -> Vec<u8> {
            let codes = CODE_ZERO_POINT.iter().map(|&zero| i32::from(zero) + above);
            codes.flat_map(i32::to_le_bytes).collect()
        };
        assert!(rms_steps(&codes(3), &[exact()]) < 0.01);
        assert!(rms_steps(&codes(100), &[exact()]) > INT8_TOLERANCE);
    }

    #[test]
    fn one_float_that_is_off_or_no_number_is_found() {
        let bytes = |codes: &[f32]| -> Vec<u8> {
            codes.iter().flat_map(|code| code.to_le_bytes()).collect()
        };
        assert!(relative(&bytes(&exact()), &[exact()]) < TORCH_TOLERANCE);
        for wrong in [f32::NAN, 1e6] {
            let mut codes = exact();
            codes[5] = wrong;
            let agreement = Agreement {
                int8_rms_steps: 0.5,
                torch_relative: Some(relative(&bytes(&codes), &[exact()])),
            };
            assert_eq!(agreement.faults().len(), 1, "{agreement:?}");
        }
    }
}
