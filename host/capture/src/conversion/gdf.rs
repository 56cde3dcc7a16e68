//! Rows as GDF and BDF files.

use std::io::{self, BufWriter, Seek, Write};

use neuro_ros::NeuroDataInfo;
use recordings::{EdfWriter, FileToWrite, GdfWriter, SignalToWrite};

use crate::conversion::block::{Block, RowWriter, StreamFile};

/// Writes one record for each block, with the status words as signals of their own.
pub(crate) struct GdfRows<W: Write + Seek> {
    writer: GdfWriter<BufWriter<W>>,
    events: Vec<(u64, u16)>,
    values: Vec<f32>,
}

impl<W: Write + Seek> GdfRows<W> {
    /// Writes the header.
    ///
    /// # Errors
    ///
    /// As [`GdfWriter::new`].
    pub(crate) fn new(out: W, file: &StreamFile<'_>) -> io::Result<GdfRows<W>> {
        let to_write = file_to_write(file);
        let events = file.events.iter();
        Ok(GdfRows {
            writer: GdfWriter::new(BufWriter::new(out), &to_write)?,
            events: events.map(|(row, event)| (*row, event.code)).collect(),
            values: Vec::new(),
        })
    }
}

/// Describes a stream: its channels, then the status words.
pub(crate) fn file_to_write(file: &StreamFile<'_>) -> FileToWrite {
    let frame = file.first;
    let groups = [&frame.eeg.info, &frame.exg.info, &frame.tri.info];
    FileToWrite {
        signals: groups.into_iter().flat_map(signals).collect(),
        rate_hz: frame.sr.into(),
        rows_per_record: frame.eeg.info.nsamples.into(),
        start_ns: file.start_ns,
        description: format!("Corticode, {}", frame.header.frame_id),
    }
}

fn signals(info: &NeuroDataInfo) -> impl Iterator<Item = SignalToWrite> {
    let end = |index: usize| info.minmax.get(index).copied().unwrap_or(0.0);
    let range = [end(0), end(1)];
    let is_microvolt = info.unit == "uV";
    let is_integer = info.isint != 0;
    let labels = info.labels.iter();
    labels.map(move |label| SignalToWrite {
        label: label.clone(),
        is_microvolt,
        is_integer,
        range,
    })
}

/// Appends the values and the status words of all rows of a block, row by row.
#[expect(clippy::cast_precision_loss, reason = "status words have 16 bits")]
pub(crate) fn append_values(block: &Block, values: &mut Vec<f32>) {
    for row in 0..block.rows() {
        values.extend(block.values(row));
        values.extend(block.words(row).iter().map(|word| *word as f32));
    }
}

impl<W: Write + Seek> RowWriter for GdfRows<W> {
    fn write(&mut self, block: &Block) -> io::Result<()> {
        self.values.clear();
        append_values(block, &mut self.values);
        self.writer.write_record(&self.values)
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        self.writer.finish(&self.events)?;
        Ok(())
    }
}

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
