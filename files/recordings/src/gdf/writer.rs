//! Writes GDF 2.20 files: float32 signals of one rate, and an event table of mode 1.
//!
//! Source: A. Schlögl, "GDF - A general dataformat for biosignals", arXiv cs/0608052v10.

use std::io::{self, Seek, SeekFrom, Write};

use crate::header::{FileToWrite, SignalToWrite, invalid};

/// First eight bytes of a file: format and version.
const MAGIC: &[u8; 8] = b"GDF 2.20";
/// Byte offset of the number of records in the header.
const RECORDS_AT: u64 = 236;
/// GDF's type number of float32.
const FLOAT32: u32 = 16;
/// GDF's codes of two units: microvolt and dimensionless.
const MICROVOLT: u16 = 4275;
const DIMENSIONLESS: u16 = 512;
/// Largest number of rows in an event table, whose header stores the number in 24 bits.
const MAX_EVENTS: usize = 0xff_ffff;

/// Writes a GDF file record by record. Values are stored unchanged as float32.
#[derive(Debug)]
pub struct GdfWriter<W> {
    out: W,
    signals: usize,
    rate_hz: u32,
    values_per_record: usize,
    records: i64,
    record: Vec<u8>,
}

impl<W: Write + Seek> GdfWriter<W> {
    /// Writes the header of the file and returns a writer for its records.
    ///
    /// # Errors
    /// `InvalidInput` if there are no signals or more than a GDF file holds, if a record has no
    /// rows, or if the rate is 0; otherwise the operating system's error.
    pub fn new(mut out: W, file: &FileToWrite) -> io::Result<GdfWriter<W>> {
        out.write_all(&header(file)?)?;
        let signals = file.signals.len();
        Ok(GdfWriter {
            out,
            signals,
            rate_hz: file.rate_hz,
            values_per_record: signals * file.rows_per_record as usize,
            records: 0,
            record: Vec::new(),
        })
    }

    /// Writes one record. `rows` holds the values of all signals in the first row, then in the
    /// second row, and so on.
    ///
    /// # Errors
    /// `InvalidInput` if `rows` is not exactly one record; otherwise the operating system's error.
    pub fn write_record(&mut self, rows: &[f32]) -> io::Result<()> {
        if rows.len() != self.values_per_record {
            return Err(invalid("a record has another number of values"));
        }
        self.record.clear();
        for signal in 0..self.signals {
            let values = rows.iter().skip(signal).step_by(self.signals);
            self.record.extend(values.flat_map(|value| value.to_le_bytes()));
        }
        self.records += 1;
        self.out.write_all(&self.record)
    }

    /// Appends the event table, made from pairs (row counted from 0, GDF type), writes the number
    /// of records into the header, and returns the output.
    ///
    /// # Errors
    /// `InvalidInput` if an event's row or the number of events does not fit the table; otherwise
    /// the operating system's error.
    pub fn finish(mut self, events: &[(u64, u16)]) -> io::Result<W> {
        let count = u32::try_from(events.len()).ok();
        let count = count.filter(|_| events.len() <= MAX_EVENTS);
        let [c0, c1, c2, _] = count
            .ok_or_else(|| invalid("a GDF file holds at most 16,777,215 events"))?
            .to_le_bytes();
        #[expect(clippy::cast_precision_loss, reason = "GDF stores the rate as float32")]
        let rate_hz = self.rate_hz as f32;
        let mut table = vec![1, c0, c1, c2];
        table.extend(rate_hz.to_le_bytes());
        for (row, _) in events {
            let position = u32::try_from(row.saturating_add(1));
            let position =
                position.map_err(|_| invalid("an event is later than row 2^32 of a GDF file"))?;
            table.extend(position.to_le_bytes());
        }
        table.extend(events.iter().flat_map(|(_, kind)| kind.to_le_bytes()));
        self.out.write_all(&table)?;
        self.out.seek(SeekFrom::Start(RECORDS_AT))?;
        self.out.write_all(&self.records.to_le_bytes())?;
        self.out.flush()?;
        Ok(self.out)
    }
}

/// Returns `text` as `width` bytes: padded with zeros, or cut after the last character that fits.
fn padded(text: &str, width: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes()[..text.floor_char_boundary(width)].to_vec();
    bytes.resize(width, 0);
    bytes
}

fn header(file: &FileToWrite) -> io::Result<Vec<u8>> {
    let count = u16::try_from(file.signals.len()).ok();
    let Some(count) = count.filter(|count| (1..u16::MAX).contains(count)) else {
        return Err(invalid("a GDF file has 1 to 65,534 signals"));
    };
    file.check()?;
    let mut bytes = MAGIC.to_vec();
    // `X` means that the patient is unknown.
    bytes.extend(padded("X X", 66));
    bytes.resize(88, 0);
    bytes.extend(padded(&file.description, 64));
    // The zeros before the time mean that the place of the recording is not stated.
    bytes.resize(168, 0);
    bytes.extend(gdf_time(file.start_ns.unwrap_or(UNKNOWN_NS)).to_le_bytes());
    // The zeros mean that the patient's birthday is not stated.
    bytes.resize(184, 0);
    bytes.extend((count + 1).to_le_bytes());
    bytes.resize(236, 0);
    // The number of records is -1, unknown, until the file is finished.
    bytes.extend((-1_i64).to_le_bytes());
    bytes.extend(file.rows_per_record.to_le_bytes());
    bytes.extend(file.rate_hz.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    bytes.extend([0; 2]);
    let mut field = |of: &dyn Fn(&SignalToWrite) -> Vec<u8>| {
        bytes.extend(file.signals.iter().flat_map(of));
    };
    field(&|signal| padded(&signal.label, 16));
    field(&|_| vec![0; 80]);
    field(&|signal| padded(signal.unit(), 6));
    field(&|signal| {
        let code = if signal.is_microvolt { MICROVOLT } else { DIMENSIONLESS };
        code.to_le_bytes().to_vec()
    });
    // Write the physical range, then the digital range. Both are equal, so values are stored
    // unchanged.
    for end in [0, 1, 0, 1] {
        field(&|signal| signal.range[end].to_le_bytes().to_vec());
    }
    // Prefilter text, time offset, low-pass, high-pass and notch are not stated.
    field(&|_| vec![0; 68]);
    field(&|_| f32::NAN.to_le_bytes().repeat(3));
    field(&|_| file.rows_per_record.to_le_bytes().to_vec());
    field(&|_| FLOAT32.to_le_bytes().to_vec());
    // Position and properties of the electrodes are not stated.
    field(&|_| vec![0; 32]);
    Ok(bytes)
}

/// Start stated in a file whose start is unknown, nanoseconds since 1970: 1 January 1985, as in
/// EDF.
const UNKNOWN_NS: i64 = 473_385_600_000_000_000;
/// Number of days from GDF's day 0 (1 January of the year 0) to 1 January 1970.
const DAYS_TO_1970: i128 = 719_529;
const DAY_NS: i128 = 86_400_000_000_000;

/// Converts nanoseconds since 1970 to GDF's time format: days in the upper 32 bits, the fraction of
/// a day in the lower 32 bits.
fn gdf_time(wall_ns: i64) -> u64 {
    let days = (i128::from(wall_ns) << 32) / DAY_NS;
    u64::try_from((DAYS_TO_1970 << 32) + days).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::gdf_time;

    #[test]
    fn a_day_is_2_to_the_32() {
        assert_eq!(gdf_time(0), 719_529 << 32);
        // 2000-01-01 12:00 is 730,486.5 days after the start of the year 0.
        assert_eq!(gdf_time(946_728_000_000_000_000), (730_486 << 32) + (1 << 31));
    }
}
