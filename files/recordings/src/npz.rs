//! Writes NPZ files, arrays for `numpy.load`, in one pass.
//!
//! An NPZ file is a ZIP archive with one NPY file per array. The arrays are not compressed, and
//! their values are written as they arrive.
//!
//! ```
//! use std::io::{Cursor, Write as _};
//!
//! use recordings::npz::NpzWriter;
//!
//! let mut file = NpzWriter::new(Cursor::new(Vec::new()));
//! file.texts("labels", &["Cz", "Pz"])?;
//! file.start_array("uv", "'<f4'", &[1, 2])?;
//! for value in [1.5_f32, -2.5] {
//!     file.write_all(&value.to_le_bytes())?;
//! }
//! let bytes = file.finish()?.into_inner();
//! assert!(bytes.starts_with(b"PK"));
//! # Ok::<(), std::io::Error>(())
//! ```

use std::io::{self, BufWriter, Seek, Write};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// First bytes of an NPY file: its magic and its format version.
const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";

/// Writes the arrays of an NPZ file one after another. Bytes written through [`Write`] belong to
/// the array that was started last.
#[derive(Debug)]
pub struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<BufWriter<W>>,
}

impl<W: Write + Seek> NpzWriter<W> {
    /// Creates an NPZ file that has no arrays yet.
    pub fn new(out: W) -> Self {
        Self { zip: ZipWriter::new(BufWriter::new(out)) }
    }

    /// Starts the array `name`. `element` is the numpy type of its elements as Python source, such
    /// as `'<f4'` or `[('row', '<i8'), ('code', '<u2')]`. `shape` is empty for a single number.
    ///
    /// Source: numpy's NEP 1.
    ///
    /// # Errors
    /// The operating system's error, or an error if the header is longer than 65,535 bytes.
    pub fn start_array(&mut self, name: &str, element: &str, shape: &[u64]) -> io::Result<()> {
        // The size of the array is not known yet and could exceed 4 GB.
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(true);
        self.zip.start_file(format!("{name}.npy"), options)?;
        let lengths = shape.iter().map(|length| format!("{length},"));
        let shape: String = lengths.collect();
        let mut text =
            format!("{{'descr': {element}, 'fortran_order': False, 'shape': ({shape}), }}");
        // Pads the header so that values start at a multiple of 64; 10 bytes come before the text.
        let header = (10 + text.len() + 1).next_multiple_of(64) - 10;
        while text.len() + 1 < header {
            text.push(' ');
        }
        text.push('\n');
        self.zip.write_all(MAGIC)?;
        let length = u16::try_from(text.len()).map_err(io::Error::other)?;
        self.zip.write_all(&length.to_le_bytes())?;
        self.zip.write_all(text.as_bytes())
    }

    /// Writes an array of texts, which numpy stores as UTF-32.
    ///
    /// # Errors
    /// The errors of [`Self::start_array`].
    pub fn texts<T: AsRef<str>>(&mut self, name: &str, texts: &[T]) -> io::Result<()> {
        let lengths = texts.iter().map(|text| text.as_ref().chars().count());
        let width = lengths.max().unwrap_or(0).max(1);
        self.start_array(name, &format!("'<U{width}'"), &[texts.len() as u64])?;
        for text in texts {
            let characters = text.as_ref().chars().map(u32::from);
            for character in characters.chain(std::iter::repeat(0)).take(width) {
                self.zip.write_all(&character.to_le_bytes())?;
            }
        }
        Ok(())
    }

    /// Completes the file and returns the output.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn finish(self) -> io::Result<W> {
        self.zip.finish()?.into_inner().map_err(io::IntoInnerError::into_error)
    }
}

impl<W: Write + Seek> Write for NpzWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.zip.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.zip.flush()
    }
}
