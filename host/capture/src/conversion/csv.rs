//! Rows as lines of comma-separated values.

use std::io::{self, BufWriter, Write};

use bridge_core::TRI_LABELS;

use crate::conversion::block::{Block, RowWriter, StreamFile};

/// Writes a header line and one line per row.
pub(crate) struct CsvWriter<W: Write> {
    out: BufWriter<W>,
    row: u64,
    /// Rows and types of the events that are not written yet, the next one last.
    events: Vec<(u64, u16)>,
}

impl<W: Write> CsvWriter<W> {
    /// Writes the header line.
    ///
    /// # Errors
    ///
    /// The operating system's error.
    pub(crate) fn new(out: W, file: &StreamFile<'_>) -> io::Result<CsvWriter<W>> {
        let mut out = BufWriter::new(out);
        write!(out, "row,time_s,device_s,events")?;
        for label in TRI_LABELS
            .into_iter()
            .chain(file.labels().map(String::as_str))
        {
            write!(out, ",{}", label.replace(',', "_"))?;
        }
        writeln!(out)?;
        let events = file.events.iter().rev();
        Ok(CsvWriter {
            out,
            row: 0,
            events: events.map(|(row, event)| (*row, event.code)).collect(),
        })
    }
}

impl<W: Write> RowWriter for CsvWriter<W> {
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

/// Returns `units`, each 10^-`digits` seconds, as seconds with all digits.
fn seconds(units: i64, digits: u32) -> String {
    let one = 10_i64.pow(digits);
    let sign = if units < 0 { "-" } else { "" };
    let (whole, rest) = (units / one, (units % one).abs());
    format!(
        "{sign}{}.{rest:0width$}",
        whole.abs(),
        width = digits as usize
    )
}

#[cfg(test)]
mod tests {
    use super::seconds;

    #[test]
    fn seconds_have_all_digits_and_their_sign() {
        assert_eq!(
            seconds(1_700_000_000_000_000_001, 9),
            "1700000000.000000001"
        );
        assert_eq!(seconds(-1_500, 6), "-0.001500");
        assert_eq!(seconds(-2_000_001, 6), "-2.000001");
    }
}
