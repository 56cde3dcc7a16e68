//! Rows as arrays for numpy.

use std::io::{self, BufWriter, Seek, Write};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::conversion::block::{Block, TimedEvent};
use crate::conversion::rows::{RowWriter, StreamFile};
use crate::streams::tri::TRI_LABELS;

/// Writes a file for `numpy.load`: the arrays `labels`, `words`, `rate_hz`, `events` and `rows`.
///
/// `rows` has one element per row, so it can be written while its values appear; numpy shows its
/// fields as arrays.
pub(crate) struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<BufWriter<W>>,
    row: Vec<u8>,
}

impl<W: Write + Seek> NpzWriter<W> {
    /// Writes everything but the rows.
    ///
    /// # Errors
    ///
    /// The operating system's error.
    pub(crate) fn new(out: W, file: &StreamFile<'_>) -> io::Result<NpzWriter<W>> {
        let mut zip = ZipWriter::new(BufWriter::new(out));
        let labels: Vec<&str> = file.labels().map(String::as_str).collect();
        write_texts(&mut zip, "labels", &labels)?;
        write_texts(&mut zip, "words", &TRI_LABELS)?;
        start_array(&mut zip, "rate_hz", "'<u4'", None)?;
        zip.write_all(&u32::from(file.first.sr).to_le_bytes())?;
        let fields = "[('row', '<i8'), ('time_ns', '<i8'), ('device_us', '<i8'), ('code', '<u2')]";
        start_array(&mut zip, "events", fields, Some(file.events.len() as u64))?;
        for (row, event) in &file.events {
            let TimedEvent {
                wall_ns,
                device_us,
                code,
                ..
            } = event;
            zip.write_all(&row.to_le_bytes())?;
            zip.write_all(&wall_ns.to_le_bytes())?;
            zip.write_all(&device_us.to_le_bytes())?;
            zip.write_all(&code.to_le_bytes())?;
        }
        let fields = format!(
            "[('time_ns', '<i8'), ('device_us', '<i8'), ('words', '<u2', ({},)), ('values', \
             '<f4', ({},))]",
            TRI_LABELS.len(),
            labels.len()
        );
        start_array(&mut zip, "rows", &fields, Some(file.rows))?;
        Ok(NpzWriter {
            zip,
            row: Vec::new(),
        })
    }
}

impl<W: Write + Seek> RowWriter for NpzWriter<W> {
    fn write(&mut self, block: &Block) -> io::Result<()> {
        for row in 0..block.rows() {
            let offset_us = block.offset_us(row);
            self.row.clear();
            self.row
                .extend((block.wall_ns + offset_us * 1000).to_le_bytes());
            self.row.extend((block.first_us + offset_us).to_le_bytes());
            for word in block.words(row) {
                self.row.extend(&word.to_le_bytes()[..2]);
            }
            for value in block.values(row) {
                self.row.extend(value.to_le_bytes());
            }
            self.zip.write_all(&self.row)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.zip.finish()?.flush()
    }
}

/// Starts an array with its header, as numpy's NEP 1 describes it; `length` is `None` for a number.
fn start_array<W: Write + Seek>(
    zip: &mut ZipWriter<W>,
    name: &str,
    element: &str,
    length: Option<u64>,
) -> io::Result<()> {
    // Stored, because numpy can then map the file; its size is not known to be below 4 GB.
    let options = SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Stored)
        .large_file(true);
    zip.start_file(format!("{name}.npy"), options)?;
    let shape = length.map_or("()".to_owned(), |length| format!("({length},)"));
    let mut text = format!("{{'descr': {element}, 'fortran_order': False, 'shape': {shape}, }}");
    // Magic, version and length take 10 bytes; the data start at a multiple of 64.
    let header = (10 + text.len() + 1).next_multiple_of(64) - 10;
    while text.len() + 1 < header {
        text.push(' ');
    }
    text.push('\n');
    zip.write_all(b"\x93NUMPY\x01\x00")?;
    let length = u16::try_from(text.len()).map_err(io::Error::other)?;
    zip.write_all(&length.to_le_bytes())?;
    zip.write_all(text.as_bytes())
}

/// Writes an array of texts, in numpy's UTF-32.
fn write_texts<W: Write + Seek>(
    zip: &mut ZipWriter<W>,
    name: &str,
    texts: &[&str],
) -> io::Result<()> {
    let lengths = texts.iter().map(|text| text.chars().count());
    let width = lengths.max().unwrap_or(0).max(1);
    start_array(zip, name, &format!("'<U{width}'"), Some(texts.len() as u64))?;
    for text in texts {
        let characters = text.chars().map(u32::from);
        for character in characters.chain(std::iter::repeat(0)).take(width) {
            zip.write_all(&character.to_le_bytes())?;
        }
    }
    Ok(())
}
