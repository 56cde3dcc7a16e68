//! Reader of numpy's `.npz` files: zip archives with one `.npy` file per array.
//!
//! A `.npy` file consists of a magic number, a version, the length of the header, the header as a
//! Python dictionary, and the values (`numpy/lib/format.py`).

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use zip::ZipArchive;

/// An open `.npz` file.
#[derive(Debug)]
pub struct Npz(ZipArchive<File>);

/// A numeric array read from a `.npz` file, in row-major order.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Length of each axis, the slowest-varying axis first.
    pub shape: Vec<usize>,
    /// Values, converted to f64 if the array is float32; the index of the last axis varies fastest.
    pub values: Vec<f64>,
}

/// Reason why a `.npz` file or an array in it cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum NpzError {
    /// The file cannot be opened or read.
    #[error("cannot be read: {0}")]
    Io(#[from] io::Error),
    /// The file is not a zip archive, or has no array of the requested name.
    #[error("no such array in the archive: {0}")]
    Zip(#[from] zip::result::ZipError),
    /// The array's format is not supported; the text names the header field concerned.
    #[error("the array's {0} is not one that this reader knows: row-major `<f4` or `<f8`")]
    Format(&'static str),
}

impl Npz {
    /// Opens a `.npz` file and reads the directory of its zip archive.
    ///
    /// # Errors
    /// The file does not exist, or is not a zip archive.
    pub fn open(path: &Path) -> Result<Self, NpzError> {
        Ok(Self(ZipArchive::new(File::open(path)?)?))
    }

    /// Reads the array `name`, whose elements must be float32 or float64.
    ///
    /// # Errors
    /// The archive has no array of that name, or the array has an unsupported format.
    pub fn array(&mut self, name: &str) -> Result<Array, NpzError> {
        let mut bytes = Vec::new();
        self.0
            .by_name(&format!("{name}.npy"))?
            .read_to_end(&mut bytes)?;
        parse(&bytes)
    }
}

fn parse(bytes: &[u8]) -> Result<Array, NpzError> {
    let (header, values) = split_header(bytes).ok_or(NpzError::Format("header"))?;
    let dictionary = std::str::from_utf8(header).map_err(|_| NpzError::Format("header"))?;
    if !dictionary.contains("'fortran_order': False") {
        return Err(NpzError::Format("axis order"));
    }
    let shape = shape_in(dictionary).ok_or(NpzError::Format("shape"))?;
    let values: Vec<f64> = if dictionary.contains("'<f4'") {
        values
            .as_chunks()
            .0
            .iter()
            .map(|four| f64::from(f32::from_le_bytes(*four)))
            .collect()
    } else if dictionary.contains("'<f8'") {
        values
            .as_chunks()
            .0
            .iter()
            .map(|eight| f64::from_le_bytes(*eight))
            .collect()
    } else {
        return Err(NpzError::Format("type"));
    };
    if values.len() != shape.iter().product::<usize>() {
        return Err(NpzError::Format("length"));
    }
    Ok(Array { shape, values })
}

/// Splits a `.npy` file into its header and its values. The header's length is stored in two bytes
/// in version 1 of the format, and in four bytes in later versions.
fn split_header(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    let (version, rest) = rest.split_at_checked(2)?;
    let (length, rest) = if version[0] == 1 {
        let (length, rest) = rest.split_first_chunk::<2>()?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk::<4>()?;
        (usize::try_from(u32::from_le_bytes(*length)).ok()?, rest)
    };
    rest.split_at_checked(length)
}

/// Returns the axis lengths in a `.npy` header's entry `'shape': (240, 16, 10, 9)` or the like.
fn shape_in(dictionary: &str) -> Option<Vec<usize>> {
    let (_, rest) = dictionary.split_once("'shape': (")?;
    let (numbers, _) = rest.split_once(')')?;
    let numbers = numbers
        .split(',')
        .map(str::trim)
        .filter(|number| !number.is_empty());
    numbers.map(|number| number.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the bytes that `np.save` writes for `np.array([[1, 2, 3], [4, 5, -6]], '<f4')`.
    fn two_by_three() -> Vec<u8> {
        let header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }          \n";
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(u16::try_from(header.len()).expect("short").to_le_bytes());
        bytes.extend(header);
        for value in [1.0_f32, 2.0, 3.0, 4.0, 5.0, -6.0] {
            bytes.extend(value.to_le_bytes());
        }
        bytes
    }

    #[test]
    fn an_array_has_its_shape_and_values() {
        let array = parse(&two_by_three()).expect("an array");
        assert_eq!(array.shape, [2, 3]);
        assert_eq!(array.values, [1.0, 2.0, 3.0, 4.0, 5.0, -6.0]);
    }

    #[test]
    fn a_truncated_array_is_refused() {
        let bytes = two_by_three();
        for length in 0..bytes.len() {
            assert!(parse(&bytes[..length]).is_err(), "{length} bytes");
        }
    }
}
