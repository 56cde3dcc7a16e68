//! Golden windows: quantised windows, and the codes that every integer encoder must compute.

use crate::description::CodeFormat;
use crate::error::ArtifactError;
use crate::integer_code::IntegerCode;
use crate::tensor_file::{self, NamedTensor, TensorFile};
use safetensors::tensor::{Dtype, TensorView};
use std::path::Path;

/// Name of the file with the golden windows in an artifact's folder.
pub(crate) const GOLDEN: &str = "golden.safetensors";

/// Name of the tensor of exponents, which only codes of format `Int8Exponent` have.
const EXPONENTS: &str = "exponents";

/// Quantised windows of one model, and the codes that its integer encoder returns for them.
/// `trainer` computes them with model-gen's integer reference. Every other integer encoder must
/// return the same bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Golden {
    /// Format of the codes. The file stores `codes` `[n, numbers]` as int8 or int16, and for
    /// `Int8Exponent` also `exponents` `[n]` as uint8.
    pub format: CodeFormat,
    /// Number of time steps in a window, and number of cells in a plane of the scalp grid.
    pub window_shape: [usize; 2],
    /// Int8 windows on the scalp grid, each in the order step, row, column (the last fastest).
    pub windows: Vec<Vec<i8>>,
    /// Code that the integer encoder must return for each window, in the same order.
    pub codes: Vec<IntegerCode>,
}

impl Golden {
    /// Reads `golden.safetensors` from an artifact's folder.
    ///
    /// # Errors
    /// If the file cannot be read or does not hold windows `[n, steps, cells]` and codes
    /// `[n, numbers]`.
    pub fn read(folder: &Path) -> Result<Self, ArtifactError> {
        let path = folder.join(GOLDEN);
        let bytes = std::fs::read(&path).map_err(ArtifactError::file(&path))?;
        Self::from_bytes(&bytes)
    }

    /// Parses the contents of `golden.safetensors`.
    ///
    /// # Errors
    /// If the contents are not windows `[n, steps, cells]` and codes `[n, numbers]`.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ArtifactError> {
        let file = TensorFile::parse(GOLDEN, bytes)?;
        let [count, steps, cells] = shape(&file, "windows")?;
        let windows = file.elements("windows", Dtype::I8, &[count, steps, cells])?;
        let windows: Vec<i8> = windows.iter().map(|byte| byte.cast_signed()).collect();
        let windows = windows.chunks_exact((steps * cells).max(1));

        let is_wide = |view: TensorView<'_>| view.dtype() == Dtype::I16;
        let format = if file.tensor(EXPONENTS).is_ok() {
            CodeFormat::Int8Exponent
        } else if file.tensor("codes").is_ok_and(is_wide) {
            CodeFormat::Int16
        } else {
            CodeFormat::Int8
        };
        let [_, numbers] = shape(&file, "codes")?;
        let values = file.elements("codes", element_type(format), &[count, numbers])?;
        let values: Vec<i16> = match format {
            CodeFormat::Int8 | CodeFormat::Int8Exponent => {
                let values = values.iter().map(|byte| byte.cast_signed());
                values.map(i16::from).collect()
            }
            CodeFormat::Int16 => {
                let (values, _) = values.as_chunks::<2>();
                values.iter().map(|&b| i16::from_le_bytes(b)).collect()
            }
        };
        let exponents = match format {
            CodeFormat::Int8Exponent => file.elements(EXPONENTS, Dtype::U8, &[count])?.to_vec(),
            CodeFormat::Int8 | CodeFormat::Int16 => vec![0; count],
        };
        let codes = exponents.into_iter().zip(values.chunks_exact(numbers.max(1)));
        Ok(Self {
            format,
            window_shape: [steps, cells],
            windows: windows.map(<[i8]>::to_vec).collect(),
            codes: codes
                .map(|(exponent, values)| IntegerCode { exponent, values: values.to_vec() })
                .collect(),
        })
    }

    /// Writes `golden.safetensors` into an artifact's folder.
    ///
    /// # Errors
    /// If the file cannot be written.
    ///
    /// # Panics
    /// If there are not as many codes as windows.
    pub fn write(&self, folder: &Path) -> Result<(), ArtifactError> {
        let path = folder.join(GOLDEN);
        std::fs::write(&path, self.to_bytes()?).map_err(ArtifactError::file(&path))
    }

    fn to_bytes(&self) -> Result<Vec<u8>, ArtifactError> {
        let count = self.windows.len();
        assert_eq!(count, self.codes.len(), "every window has a code");
        let [steps, cells] = self.window_shape;
        let numbers = self.codes.first().map_or(0, |code| code.values.len());
        let windows = self.windows.iter().flatten();
        let windows: Vec<u8> = windows.map(|q| q.cast_unsigned()).collect();
        let values = self.codes.iter().flat_map(|code| &code.values);
        let width = element_type(self.format).bitsize() / 8;
        let values: Vec<u8> =
            values.flat_map(|value| value.to_le_bytes().into_iter().take(width)).collect();
        let exponents: Vec<u8> = self.codes.iter().map(|code| code.exponent).collect();
        let kind = element_type(self.format);
        let mut tensors: Vec<NamedTensor> = vec![
            ("codes", kind, vec![count, numbers], values),
            ("windows", Dtype::I8, vec![count, steps, cells], windows),
        ];
        if self.format == CodeFormat::Int8Exponent {
            tensors.push((EXPONENTS, Dtype::U8, vec![count], exponents));
        }
        tensor_file::to_bytes(GOLDEN, &tensors)
    }
}

/// Returns the element type with which the file stores codes of this format.
fn element_type(format: CodeFormat) -> Dtype {
    match format {
        CodeFormat::Int8 | CodeFormat::Int8Exponent => Dtype::I8,
        CodeFormat::Int16 => Dtype::I16,
    }
}

/// Returns the lengths of the first `N` dimensions of a tensor. A missing dimension has the length
/// 0, which the check of the elements refuses.
fn shape<const N: usize>(file: &TensorFile, name: &str) -> Result<[usize; N], ArtifactError> {
    let view = file.tensor(name)?;
    let lengths = view.shape();
    Ok(std::array::from_fn(|axis| lengths.get(axis).copied().unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::TensorProblem;

    fn golden(format: CodeFormat) -> Golden {
        let windows = [-128, 0, 127].map(|value| vec![value; 16 * 90]).to_vec();
        let [least, greatest] = format.range();
        let codes = [least, -1, greatest].map(|value| IntegerCode {
            exponent: format.largest_exponent(),
            values: vec![value; 128],
        });
        Golden { format, window_shape: [16, 90], windows, codes: codes.to_vec() }
    }

    #[test]
    fn written_golden_windows_read_back_in_every_format() {
        for format in [CodeFormat::Int8, CodeFormat::Int8Exponent, CodeFormat::Int16] {
            let folder = tempfile::tempdir().unwrap();
            golden(format).write(folder.path()).unwrap();
            assert_eq!(Golden::read(folder.path()).unwrap(), golden(format));
        }
    }

    #[test]
    fn writing_the_checked_in_file_reproduces_its_bytes() {
        let bytes = include_bytes!("../../../signal/model/artifact/golden.safetensors");
        let golden = Golden::from_bytes(bytes).unwrap();
        assert!(golden.to_bytes().unwrap() == bytes);
    }

    #[test]
    fn a_number_of_codes_other_than_that_of_windows_is_refused() {
        let tensors = [
            ("codes", Dtype::I8, vec![2, 128], vec![0; 2 * 128]),
            ("windows", Dtype::I8, vec![1, 16, 90], vec![0; 16 * 90]),
        ];
        let bytes = tensor_file::to_bytes(GOLDEN, &tensors).unwrap();
        assert!(matches!(
            Golden::from_bytes(&bytes),
            Err(ArtifactError::Tensor { problem: TensorProblem::Shape(..), .. })
        ));
    }
}
