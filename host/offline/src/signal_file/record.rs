//! Writes decoded signals as files of records: EDF+, BDF+ and GDF.

use std::{
    fs::File,
    io::{self, BufWriter},
};

use link::Flags;
use recordings::{EdfWriter, FileToWrite, GdfWriter};

use super::{Signal, SignalFile, SignalFormat};

/// Range of the values in an EDF file, uV: 16-bit integers in units of 0.1 uV.
const EDF_RANGE_UV: [f64; 2] = [-3_276.8, 3_276.7];

/// Bit of an event's type that marks the end of the event (GDF 2.20).
const GDF_END: u16 = 0x8000;

/// Writes one record for each hop to an EDF or BDF file.
pub(super) struct EdfFile {
    writer: EdfWriter<BufWriter<File>>,
    range_uv: [f64; 2],
    limited: u64,
}

impl EdfFile {
    /// Writes an EDF header if `format` is EDF, otherwise a BDF header.
    pub(super) fn new(file: File, signal: &Signal, format: SignalFormat) -> io::Result<Self> {
        let (range_uv, create): (_, fn(_, &_, _, _) -> _) = match format {
            SignalFormat::Edf => (EDF_RANGE_UV, EdfWriter::edf),
            _ => (signal.range_uv(), EdfWriter::bdf),
        };
        let events = signal.events.iter();
        let annotations = events.map(|event| (event.rows.clone(), event.text.clone())).collect();
        let to_write = file_to_write(signal, range_uv);
        Ok(Self {
            writer: create(BufWriter::new(file), &to_write, signal.rows, annotations)?,
            range_uv,
            limited: 0,
        })
    }
}

impl SignalFile for EdfFile {
    fn write_hop(&mut self, uv: &[f32], _: Flags) -> io::Result<()> {
        let [least, most] = self.range_uv;
        let beyond = uv.iter().map(|value| f64::from(*value));
        let beyond = beyond.filter(|value| !(least..=most).contains(value));
        self.limited += beyond.count() as u64;
        self.writer.write_record(uv)
    }

    fn finish(self: Box<Self>) -> io::Result<u64> {
        self.writer.finish()?;
        Ok(self.limited)
    }
}

/// Writes one record for each hop to a GDF file; values are float32 and unchanged.
pub(super) struct GdfFile {
    writer: GdfWriter<BufWriter<File>>,
    /// Row and type of each event. GDF stores the events at the end of the file.
    events: Vec<(u64, u16)>,
}

impl GdfFile {
    pub(super) fn new(file: File, signal: &Signal) -> io::Result<Self> {
        let to_write = file_to_write(signal, signal.range_uv());
        let events = signal.events.iter();
        let events = events.filter_map(|event| Some((event.rows.clone(), event.kind?)));
        let events = events.flat_map(|(rows, kind)| {
            let end = (!rows.is_empty()).then_some((rows.end, kind | GDF_END));
            [(rows.start, kind)].into_iter().chain(end)
        });
        let mut events: Vec<(u64, u16)> = events.collect();
        events.sort_by_key(|(row, _)| *row);
        Ok(Self { writer: GdfWriter::new(BufWriter::new(file), &to_write)?, events })
    }
}

impl SignalFile for GdfFile {
    fn write_hop(&mut self, uv: &[f32], _: Flags) -> io::Result<()> {
        self.writer.write_record(uv)
    }

    fn finish(self: Box<Self>) -> io::Result<u64> {
        self.writer.finish(&self.events)?;
        Ok(0)
    }
}

/// Describes the file of a signal whose values are within `range`, microvolts.
fn file_to_write(signal: &Signal, range: [f64; 2]) -> FileToWrite {
    let [rate_hz, rows] = [signal.rate_hz, signal.rows_per_hop];
    FileToWrite {
        description: signal.description.clone(),
        // The start time is left out, because a file of codes does not state it.
        ..FileToWrite::microvolts(signal.labels, range, rate_hz, rows)
    }
}
