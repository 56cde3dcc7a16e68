use crate::error::ArtifactError;
use crate::shapes::{CELLS, CODE, STEPS};
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};
use std::path::Path;

/// Name of the file in the artifact's folder.
const FILE: &str = "golden.safetensors";

/// Quantised windows and the codes that the integer encoder of this model makes of them.
///
/// Written by `trainer` from `model-gen`'s integer reference; every other integer encoder must give
/// the same bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Golden {
    /// int8 planes of the scalp grid, 16 to a window.
    pub windows: Vec<[[i8; CELLS]; STEPS]>,
    /// The code of each window.
    pub codes: Vec<[i8; CODE]>,
}

impl Golden {
    /// Reads `golden.safetensors` of an artifact's folder.
    ///
    /// # Errors
    /// When the file cannot be read or holds no windows `[n, 16, 90]` and codes `[n, 128]`.
    pub fn read(folder: &Path) -> Result<Self, ArtifactError> {
        let path = folder.join(FILE);
        let bytes = std::fs::read(&path).map_err(|source| ArtifactError::File { path, source })?;
        Self::from_bytes(&bytes)
    }

    /// Golden windows from the contents of their file.
    ///
    /// # Errors
    /// When the contents hold no windows `[n, 16, 90]` and codes `[n, 128]`.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ArtifactError> {
        let file = SafeTensors::deserialize(bytes)
            .map_err(|source| ArtifactError::Safetensors { file: FILE, source })?;
        let (count, windows) = int8(&file, "windows", &[STEPS, CELLS])?;
        let (codes_count, codes) = int8(&file, "codes", &[CODE])?;
        if codes_count != count {
            return Err(ArtifactError::Shape {
                file: FILE,
                name: "codes".to_owned(),
                found: vec![codes_count, CODE],
                expected: vec![count, CODE],
            });
        }
        let (planes, _) = windows.as_chunks::<CELLS>();
        let (windows, _) = planes.as_chunks::<STEPS>();
        let (codes, _) = codes.as_chunks::<CODE>();
        Ok(Self {
            windows: windows.to_vec(),
            codes: codes.to_vec(),
        })
    }

    /// Writes `golden.safetensors` into an artifact's folder.
    ///
    /// # Errors
    /// When the file cannot be written.
    ///
    /// # Panics
    /// When there are not as many codes as windows.
    pub fn write(&self, folder: &Path) -> Result<(), ArtifactError> {
        let path = folder.join(FILE);
        std::fs::write(&path, self.to_bytes()?)
            .map_err(|source| ArtifactError::File { path, source })
    }

    fn to_bytes(&self) -> Result<Vec<u8>, ArtifactError> {
        let count = self.windows.len();
        assert_eq!(count, self.codes.len(), "every window has a code");
        let error = |source| ArtifactError::Safetensors { file: FILE, source };
        let bytes =
            |values: &[i8]| -> Vec<u8> { values.iter().map(|v| v.cast_unsigned()).collect() };
        let windows = bytes(self.windows.as_flattened().as_flattened());
        let codes = bytes(self.codes.as_flattened());
        let views = [
            (
                "codes",
                TensorView::new(Dtype::I8, vec![count, CODE], &codes).map_err(error)?,
            ),
            (
                "windows",
                TensorView::new(Dtype::I8, vec![count, STEPS, CELLS], &windows).map_err(error)?,
            ),
        ];
        safetensors::serialize(views, None).map_err(error)
    }
}

/// Count and elements of a tensor `[count, ...rest]`.
fn int8(file: &SafeTensors, name: &str, rest: &[usize]) -> Result<(usize, Vec<i8>), ArtifactError> {
    let view = file
        .tensor(name)
        .map_err(|_| ArtifactError::MissingTensor {
            file: FILE,
            name: name.to_owned(),
        })?;
    if view.dtype() != Dtype::I8 {
        return Err(ArtifactError::ElementType {
            file: FILE,
            name: name.to_owned(),
            found: format!("{:?}", view.dtype()),
            expected: "I8",
        });
    }
    let count = view.shape().first().copied().unwrap_or(0);
    let expected = [&[count], rest].concat();
    if view.shape() != expected {
        return Err(ArtifactError::Shape {
            file: FILE,
            name: name.to_owned(),
            found: view.shape().to_vec(),
            expected,
        });
    }
    Ok((
        count,
        view.data().iter().map(|byte| byte.cast_signed()).collect(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn golden() -> Golden {
        let windows = [-128, 0, 127].map(|value| [[value; CELLS]; STEPS]).to_vec();
        Golden {
            windows,
            codes: vec![[-1; CODE], [2; CODE], [3; CODE]],
        }
    }

    #[test]
    fn what_is_written_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        golden().write(folder.path()).unwrap();
        assert_eq!(Golden::read(folder.path()).unwrap(), golden());
    }

    #[test]
    fn another_number_of_codes_than_windows_is_refused() {
        let codes = [0; 2 * CODE];
        let windows = [0; STEPS * CELLS];
        let bytes = safetensors::serialize(
            [
                (
                    "codes",
                    TensorView::new(Dtype::I8, vec![2, CODE], &codes).unwrap(),
                ),
                (
                    "windows",
                    TensorView::new(Dtype::I8, vec![1, STEPS, CELLS], &windows).unwrap(),
                ),
            ],
            None,
        )
        .unwrap();
        assert!(matches!(
            Golden::from_bytes(&bytes),
            Err(ArtifactError::Shape { .. })
        ));
    }
}
