//! Writes decoded signals as comma-separated values.

use std::{
    fs::File,
    io::{self, BufWriter, Write as _},
};

use link::Flags;
use picture::page::csv_field;

use super::{RowEvent, Signal, SignalFile};

/// Writes a header line, and one line per row: `row`, `time_s` (time at the electrodes since the
/// first sample), `flags`, `events` (separated by `|`), and one column per electrode.
pub(super) struct CsvFile {
    out: BufWriter<File>,
    electrodes: usize,
    rate_hz: i64,
    group_delay_us: i64,
    row: u64,
    /// Events that are not written yet, in reverse order: the last element is written next.
    events: Vec<RowEvent>,
}

impl CsvFile {
    pub(super) fn new(file: File, signal: &Signal) -> io::Result<Self> {
        let mut out = BufWriter::new(file);
        write!(out, "row,time_s,flags,events")?;
        for label in signal.labels {
            write!(out, ",{label}")?;
        }
        writeln!(out)?;
        Ok(Self {
            out,
            electrodes: signal.labels.len(),
            rate_hz: signal.rate_hz.into(),
            group_delay_us: signal.group_delay_us.into(),
            row: 0,
            events: signal.events.iter().rev().cloned().collect(),
        })
    }

    /// Returns the time at which the electrodes had the values of the next row, as text in seconds.
    fn time_s(&self) -> String {
        let row = i64::try_from(self.row).unwrap_or(i64::MAX);
        let us = row.saturating_mul(1_000_000) / self.rate_hz - self.group_delay_us;
        let sign = if us < 0 { "-" } else { "" };
        let us = us.abs();
        format!("{sign}{}.{:06}", us / 1_000_000, us % 1_000_000)
    }
}

impl SignalFile for CsvFile {
    fn write_hop(&mut self, uv: &[f32], flags: Flags) -> io::Result<()> {
        for values in uv.chunks_exact(self.electrodes) {
            write!(self.out, "{},{},{},", self.row, self.time_s(), flags.bits())?;
            let mut texts = Vec::new();
            while let Some(event) = self.events.pop_if(|event| event.rows.start <= self.row) {
                texts.push(event.text);
            }
            write!(self.out, "{}", csv_field(&texts.join("|")))?;
            for value in values {
                write!(self.out, ",{value}")?;
            }
            writeln!(self.out)?;
            self.row += 1;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<u64> {
        self.out.flush()?;
        Ok(0)
    }
}
