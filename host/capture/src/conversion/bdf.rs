//! Rows as a BDF+ file.

use std::io::{self, BufWriter, Seek, Write};

use recordings::EdfWriter;

use crate::conversion::block::Block;
use crate::conversion::gdf::{append_values, file_to_write};
use crate::conversion::rows::{RowWriter, StreamFile};

/// Writes one record for each block, with the status words as signals of their own.
pub(crate) struct BdfRows<W: Write + Seek> {
    writer: EdfWriter<BufWriter<W>>,
    values: Vec<f32>,
}

impl<W: Write + Seek> BdfRows<W> {
    /// Writes the header.
    ///
    /// # Errors
    ///
    /// As [`EdfWriter::bdf`].
    pub(crate) fn new(out: W, file: &StreamFile<'_>) -> io::Result<BdfRows<W>> {
        let events = file.events.iter();
        let texts = events.map(|(row, event)| (*row, event.description.clone()));
        let out = BufWriter::new(out);
        Ok(BdfRows {
            writer: EdfWriter::bdf(out, &file_to_write(file), file.rows, texts.collect())?,
            values: Vec::new(),
        })
    }
}

impl<W: Write + Seek> RowWriter for BdfRows<W> {
    fn write(&mut self, block: &Block) -> io::Result<()> {
        self.values.clear();
        append_values(block, &mut self.values);
        self.writer.write_record(&self.values)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.writer.finish()?;
        Ok(())
    }
}
