//! Rows as arrays for numpy.

use std::io::{self, Seek, Write};

use bridge_core::TRI_LABELS;
use recordings::npz::NpzWriter;

use crate::conversion::block::{Block, RowWriter, StreamFile, TimedEvent};

/// Writes a file for `numpy.load`: the arrays `labels`, `words`, `rate_hz`, `events` and `rows`.
///
/// `rows` has one element per row, so it can be written while its values appear; numpy shows its
/// fields as arrays.
pub(crate) struct NpzRows<W: Write + Seek> {
    file: NpzWriter<W>,
    row: Vec<u8>,
}

impl<W: Write + Seek> NpzRows<W> {
    /// Writes everything but the rows.
    ///
    /// # Errors
    ///
    /// The operating system's error.
    pub(crate) fn new(out: W, file: &StreamFile<'_>) -> io::Result<NpzRows<W>> {
        let mut npz = NpzWriter::new(out);
        let labels: Vec<&str> = file.labels().map(String::as_str).collect();
        npz.texts("labels", &labels)?;
        npz.texts("words", &TRI_LABELS)?;
        npz.start_array("rate_hz", "'<u4'", &[])?;
        npz.write_all(&u32::from(file.first.sr).to_le_bytes())?;
        let fields = "[('row', '<i8'), ('time_ns', '<i8'), ('device_us', '<i8'), ('code', '<u2')]";
        npz.start_array("events", fields, &[file.events.len() as u64])?;
        for (row, event) in &file.events {
            let TimedEvent {
                wall_ns,
                device_us,
                code,
                ..
            } = event;
            npz.write_all(&row.to_le_bytes())?;
            npz.write_all(&wall_ns.to_le_bytes())?;
            npz.write_all(&device_us.to_le_bytes())?;
            npz.write_all(&code.to_le_bytes())?;
        }
        let fields = format!(
            "[('time_ns', '<i8'), ('device_us', '<i8'), ('words', '<u2', ({},)), ('values', \
             '<f4', ({},))]",
            TRI_LABELS.len(),
            labels.len()
        );
        npz.start_array("rows", &fields, &[file.rows])?;
        Ok(NpzRows {
            file: npz,
            row: Vec::new(),
        })
    }
}

impl<W: Write + Seek> RowWriter for NpzRows<W> {
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
            self.file.write_all(&self.row)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.file.finish()?.flush()
    }
}
