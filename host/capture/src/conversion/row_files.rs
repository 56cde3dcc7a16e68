//! Writers of a stream's rows in four formats: CSV, GDF, BDF and arrays for numpy.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use bridge_core::TRI_LABELS;
use neuro_ros::{NeuroDataInfo, NeuroFrame};
use recordings::npz::NpzWriter;
use recordings::{EdfWriter, FileToWrite, GdfWriter, SignalToWrite};

use crate::conversion::block::{Block, STREAMS, TimedEvent};
use crate::conversion::collector::Listener;

/// What a writer must know of a stream before its first row.
pub(crate) struct StreamFile<'a> {
    /// First frame of the stream, for its labels, units, ranges and rate.
    pub(crate) first: &'a NeuroFrame,
    /// Number of rows that will be written.
    pub(crate) rows: u64,
    /// Wall clock when the first row happened, nanoseconds since 1970.
    pub(crate) start_ns: i64,
    /// All events, each with the index of its row, in the order of the rows.
    pub(crate) events: Vec<(u64, TimedEvent)>,
}

impl StreamFile<'_> {
    /// Returns the labels of the values in a row: the electrodes first, then spare channels.
    pub(crate) fn labels(&self) -> impl Iterator<Item = &String> {
        let eeg = self.first.eeg.info.labels.iter();
        eeg.chain(&self.first.exg.info.labels)
    }
}

/// Writes the rows of one stream to a file in one format.
pub(crate) trait RowWriter {
    /// Writes the rows of a block. The error is the operating system's, or `InvalidInput` if the
    /// format cannot hold a value.
    fn write(&mut self, block: &Block) -> io::Result<()>;

    /// Writes what the format stores at the end of a file, such as GDF's table of events, and
    /// flushes the file.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

/// The writers of all streams. A stream's discriminant is the index of its writer.
#[derive(Default)]
pub(crate) struct Rows {
    pub(crate) writers: [Option<Box<dyn RowWriter>>; STREAMS],
    /// Number of rows of each stream so far.
    pub(crate) counts: [u64; STREAMS],
    /// Index of the first writer that failed, and its error.
    pub(crate) failed: Option<(usize, io::Error)>,
}

impl Listener for Rows {
    const DECODES: bool = true;

    fn block(&mut self, block: Block) {
        let stream = block.stream as usize;
        self.counts[stream] += block.rows() as u64;
        if let Some(writer) = &mut self.writers[stream]
            && let Err(error) = writer.write(&block)
        {
            self.failed.get_or_insert((stream, error));
        }
    }

    fn event(&mut self, _: TimedEvent) {}
}

/// Writes a CSV file: a line with the names of the columns, and one line per row.
pub(crate) struct CsvRows {
    out: BufWriter<File>,
    row: u64,
    /// Row and code of each event not written yet, in reverse order: the last element comes next.
    events: Vec<(u64, u16)>,
}

impl CsvRows {
    /// Creates the writer, and writes the line with the names of the columns.
    pub(crate) fn new(out: File, file: &StreamFile<'_>) -> io::Result<CsvRows> {
        let mut out = BufWriter::new(out);
        write!(out, "row,time_s,device_s,events")?;
        let labels = file.labels().map(String::as_str);
        for label in TRI_LABELS.into_iter().chain(labels) {
            write!(out, ",{}", label.replace(',', "_"))?;
        }
        writeln!(out)?;
        let events = file.events.iter().rev();
        Ok(CsvRows { out, row: 0, events: events.map(|(row, event)| (*row, event.code)).collect() })
    }
}

impl RowWriter for CsvRows {
    fn write(&mut self, block: &Block) -> io::Result<()> {
        for row in 0..block.rows() {
            let offset_us = block.offset_us(row);
            let wall_ns = block.wall_ns + offset_us * 1000;
            let device_us = block.first_us + offset_us;
            write!(self.out, "{},{},", self.row, seconds(wall_ns, 9))?;
            write!(self.out, "{},", seconds(device_us, 6))?;
            let mut separator = "";
            while let Some((_, code)) = self.events.pop_if(|(at, _)| *at <= self.row) {
                write!(self.out, "{separator}{code}")?;
                separator = ";";
            }
            for word in block.words(row) {
                write!(self.out, ",{word}")?;
            }
            for value in block.values(row) {
                write!(self.out, ",{value}")?;
            }
            writeln!(self.out)?;
            self.row += 1;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.out.flush()
    }
}

/// Returns a time as text in seconds with `digits` decimals; the unit of `units` is 10^-`digits`
/// seconds.
fn seconds(units: i64, digits: u32) -> String {
    let one = 10_i64.pow(digits);
    let sign = if units < 0 { "-" } else { "" };
    let (whole, rest) = (units / one, (units % one).abs());
    format!("{sign}{}.{rest:0width$}", whole.abs(), width = digits as usize)
}

/// Status words that a GDF or BDF file holds as signals: index in [`TRI_LABELS`], and label.
/// Readers such as MNE know these two labels as digital channels, and take every other signal for
/// EEG. The other words can be derived from a row's index, or are only in CSV and NPZ files.
const WORD_SIGNALS: [(usize, &str); 2] = [(7, "trigger"), (0, "status")];

/// Writes a GDF or BDF file, with one of the format's records for each block of rows. Two status
/// words are written as signals.
pub(crate) struct RecordRows {
    file: RecordFile,
    /// Values of the block in progress; reused, so that a block needs no allocation.
    values: Vec<f32>,
}

enum RecordFile {
    /// A GDF file, and row and event code of each event. GDF stores the events at the end of the
    /// file.
    Gdf(GdfWriter<BufWriter<File>>, Vec<(u64, u16)>),
    Bdf(EdfWriter<BufWriter<File>>),
}

impl RecordRows {
    pub(crate) fn gdf(out: File, file: &StreamFile<'_>) -> io::Result<RecordRows> {
        let writer = GdfWriter::new(BufWriter::new(out), &file_to_write(file))?;
        let events = file.events.iter().map(|(row, event)| (*row, event.code));
        Ok(RecordRows { file: RecordFile::Gdf(writer, events.collect()), values: Vec::new() })
    }

    pub(crate) fn bdf(out: File, file: &StreamFile<'_>) -> io::Result<RecordRows> {
        let events = file.events.iter();
        let texts = events.map(|(row, event)| (*row..*row, event.description.clone()));
        let (out, to_write) = (BufWriter::new(out), file_to_write(file));
        let writer = EdfWriter::bdf(out, &to_write, file.rows, texts.collect())?;
        Ok(RecordRows { file: RecordFile::Bdf(writer), values: Vec::new() })
    }
}

impl RowWriter for RecordRows {
    #[expect(clippy::cast_precision_loss, reason = "status words have 16 bits")]
    fn write(&mut self, block: &Block) -> io::Result<()> {
        self.values.clear();
        for row in 0..block.rows() {
            self.values.extend(block.values(row));
            let words = block.words(row);
            let words = WORD_SIGNALS.map(|(index, _)| words[index] as f32);
            self.values.extend(words);
        }
        match &mut self.file {
            RecordFile::Gdf(writer, _) => writer.write_record(&self.values),
            RecordFile::Bdf(writer) => writer.write_record(&self.values),
        }
    }

    fn finish(self: Box<Self>) -> io::Result<()> {
        match self.file {
            RecordFile::Gdf(writer, events) => writer.finish(&events).map(drop),
            RecordFile::Bdf(writer) => writer.finish().map(drop),
        }
    }
}

/// Returns the description of a stream's file; its signals are channels, then two status words.
fn file_to_write(file: &StreamFile<'_>) -> FileToWrite {
    let frame = file.first;
    let channels = [&frame.eeg.info, &frame.exg.info].into_iter();
    let words = signals(&frame.tri.info).collect::<Vec<_>>();
    let words = WORD_SIGNALS
        .map(|(index, label)| SignalToWrite { label: label.to_owned(), ..words[index].clone() });
    FileToWrite {
        signals: channels.flat_map(signals).chain(words).collect(),
        rate_hz: frame.sr.into(),
        rows_per_record: frame.eeg.info.nsamples.into(),
        start_ns: Some(file.start_ns),
        description: format!("Corticode, {}", frame.header.frame_id),
    }
}

/// Returns the signals that `info`, a part of the stream's first frame, describes.
fn signals(info: &NeuroDataInfo) -> impl Iterator<Item = SignalToWrite> {
    let end = |index: usize| info.minmax.get(index).copied().unwrap_or(0.0);
    let range = [end(0), end(1)];
    let is_microvolt = info.unit == "uV";
    let is_integer = info.isint != 0;
    let labels = info.labels.iter();
    labels.map(move |label| SignalToWrite { label: label.clone(), is_microvolt, is_integer, range })
}

/// Writes a file for `numpy.load`: the arrays `labels`, `words`, `rate_hz`, `events` and `rows`.
///
/// `rows` has one element per row, with its time, words and values as fields, so that a row can be
/// written as soon as it is known. numpy shows each field as an array.
pub(crate) struct NpzRows {
    file: NpzWriter<File>,
    /// Bytes of the row in progress; reused, so that a row needs no allocation.
    row: Vec<u8>,
}

impl NpzRows {
    /// Writes all arrays but `rows`, and then the header of `rows`.
    pub(crate) fn new(out: File, file: &StreamFile<'_>) -> io::Result<NpzRows> {
        let mut npz = NpzWriter::new(out);
        let labels: Vec<&str> = file.labels().map(String::as_str).collect();
        npz.texts("labels", &labels)?;
        npz.texts("words", &TRI_LABELS)?;
        npz.start_array("rate_hz", "'<u4'", &[])?;
        npz.write_all(&u32::from(file.first.sr).to_le_bytes())?;
        let fields = "[('row', '<i8'), ('time_ns', '<i8'), ('device_us', '<i8'), ('code', '<u2')]";
        npz.start_array("events", fields, &[file.events.len() as u64])?;
        for (row, event) in &file.events {
            npz.write_all(&row.to_le_bytes())?;
            npz.write_all(&event.wall_ns.to_le_bytes())?;
            npz.write_all(&event.device_us.to_le_bytes())?;
            npz.write_all(&event.code.to_le_bytes())?;
        }
        let fields = format!(
            "[('time_ns', '<i8'), ('device_us', '<i8'), ('words', '<u2', ({},)), ('values', \
             '<f4', ({},))]",
            TRI_LABELS.len(),
            labels.len()
        );
        npz.start_array("rows", &fields, &[file.rows])?;
        Ok(NpzRows { file: npz, row: Vec::new() })
    }
}

impl RowWriter for NpzRows {
    fn write(&mut self, block: &Block) -> io::Result<()> {
        for row in 0..block.rows() {
            let offset_us = block.offset_us(row);
            self.row.clear();
            self.row.extend((block.wall_ns + offset_us * 1000).to_le_bytes());
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

#[cfg(test)]
mod tests {
    use super::seconds;

    #[test]
    fn seconds_have_all_digits_and_their_sign() {
        assert_eq!(seconds(1_700_000_000_000_000_001, 9), "1700000000.000000001");
        assert_eq!(seconds(-1_500, 6), "-0.001500");
        assert_eq!(seconds(-2_000_001, 6), "-2.000001");
    }
}
