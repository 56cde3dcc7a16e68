//! Finds and decodes the event table of a GDF file, which follows the records.

use crate::{
    error::RecordingError,
    event::{Event, EventLabel, SPARSE_SAMPLE},
    format::Format,
    header::{Header, array_at},
    ratio::Ratio,
    source::{BLOCK_BYTES, Source, in_memory, read_at},
};

/// Length in bytes of an event table's prefix: mode, count and rate.
pub(crate) const PREFIX: usize = 8;
/// Length in bytes of the longest event table that is searched for: in mode 7, 20 bytes for each of
/// 2^24 - 1 rows, the most that GDF 2 allows.
const TABLE_MAX: u64 = PREFIX as u64 + 20 * 0x00ff_ffff;
/// Bit of the mode that states that the table has columns of channels and durations.
const DURATIONS: u8 = 2;
/// Bit of the mode, from GDF 2.51 on, for a column of time stamps (u64) after all other columns.
const TIME_STAMPS: u8 = 4;

/// First GDF version whose table prefix is mode (u8), count (u24), rate (f32); in earlier versions
/// it is mode (u8), rate (u24), count (u32). The libraries biosig and MNE use the same limit.
const NEW_PREFIX: f64 = 1.94;

/// The first eight bytes of an event table; the columns follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TablePrefix {
    /// Bits that state which columns the table has: 1 for positions and types, plus [`DURATIONS`]
    /// and [`TIME_STAMPS`].
    mode: u8,
    /// Number of rows in the table.
    pub(crate) count: u32,
    /// Rate of the samples in which event positions are counted, Hz; <= 0 if the file does not
    /// state it.
    rate_hz: f64,
}

impl TablePrefix {
    pub(crate) fn parse(format: Format, bytes: [u8; PREFIX]) -> Self {
        let [mode, a, b, c, rest @ ..] = bytes;
        let middle = u32::from_le_bytes([a, b, c, 0]);
        match format {
            Format::Gdf1(version) | Format::Gdf2(version) if version < NEW_PREFIX => {
                Self { mode, count: u32::from_le_bytes(rest), rate_hz: f64::from(middle) }
            }
            _ => Self { mode, count: middle, rate_hz: f32::from_le_bytes(rest).into() },
        }
    }

    /// Returns the length of all columns of the table in bytes; `None` for an unknown mode.
    pub(crate) fn column_bytes(&self) -> Option<u64> {
        let has = |bit: u8| u64::from(self.mode & bit != 0);
        let is_known = self.mode & !(DURATIONS | TIME_STAMPS) == 1;
        let row = 6 + 6 * has(DURATIONS) + 8 * has(TIME_STAMPS);
        is_known.then_some(u64::from(self.count) * row)
    }

    /// Returns whether the table states a plausible rate: at least 1 mHz. If the file has samples
    /// where a table is expected, the rate's bytes may hold a small integer, which as a float is
    /// far below this limit.
    fn states_rate(&self) -> bool {
        self.rate_hz.is_finite() && self.rate_hz >= 1e-3
    }

    /// Returns the rate of the samples in which event positions are counted, Hz; `fallback_hz` if
    /// the file states none.
    fn rate_or(&self, fallback_hz: f64) -> f64 {
        if self.rate_hz.is_finite() && self.rate_hz > 0.0 { self.rate_hz } else { fallback_hz }
    }

    /// Decodes the events in file order from `columns`, which has [`Self::column_bytes`] bytes.
    /// `fallback_hz` is the rate if the file states none. Position 1 is the start of the file. Time
    /// stamps repeat the positions, so they are not read.
    pub(crate) fn events(&self, columns: &[u8], fallback_hz: f64) -> Vec<Event> {
        let count = self.count as usize;
        let rate_hz = self.rate_or(fallback_hz);
        let word = |at: usize| u32::from_le_bytes(array_at(columns, at));
        let half = |at: usize| u16::from_le_bytes(array_at(columns, at));
        (0..count)
            .map(|i| {
                let position = word(4 * i);
                let kind = half(4 * count + 2 * i);
                let (mut signal, mut duration_s) = (None, None);
                let mut label = EventLabel::Type(kind);
                if self.mode & DURATIONS != 0 {
                    signal = half(6 * count + 2 * i).checked_sub(1);
                    let word = word(8 * count + 4 * i);
                    if kind == SPARSE_SAMPLE {
                        label = EventLabel::SparseSample(word);
                    } else {
                        duration_s = Some(f64::from(word) / rate_hz);
                    }
                }
                Event { onset_s: (f64::from(position) - 1.0) / rate_hz, duration_s, signal, label }
            })
            .collect()
    }
}

/// Returns the number of records before an event table that ends exactly at the end of the file;
/// `None` if there is no such table, so that all bytes after the header are records.
///
/// No field of the file states where the records end. The function therefore goes backwards through
/// the last [`TABLE_MAX`] bytes and tests, at the end of each record, whether the prefix of an
/// event table follows: its mode and count must yield the remaining length of the file. Samples can
/// meet this condition by chance, so [`is_table`] also checks the columns.
///
/// # Errors
/// [`RecordingError::Read`] if reading fails.
pub(crate) fn records_before_table(
    source: &mut dyn Source,
    header: &Header,
    file_bytes: u64,
) -> Result<Option<u64>, RecordingError> {
    let record_bytes = header.record_bytes();
    let data_bytes = file_bytes - header.data_start;
    let Some(room) = data_bytes.checked_sub(PREFIX as u64) else {
        return Ok(None);
    };
    let Some(last) = room.checked_div(record_bytes) else {
        return Ok(None);
    };
    let first = data_bytes.saturating_sub(TABLE_MAX).div_ceil(record_bytes);
    let per_block = (BLOCK_BYTES / record_bytes).max(1);
    let mut bytes = Vec::new();
    let mut end = last + 1;
    while end > first {
        let start = end.saturating_sub(per_block).max(first);
        bytes.resize(in_memory((end - 1 - start) * record_bytes) + PREFIX, 0);
        read_at(source, header.data_start + start * record_bytes, &mut bytes)?;
        for records in (start..end).rev() {
            let at = in_memory((records - start) * record_bytes);
            let table = TablePrefix::parse(header.format, array_at(&bytes, at));
            let columns = records * record_bytes + PREFIX as u64;
            if table.column_bytes() == Some(data_bytes - columns)
                && is_table(source, header, file_bytes, table, header.data_start + columns)?
            {
                return Ok(Some(records));
            }
        }
        end = start;
    }
    Ok(None)
}

/// Returns whether the columns at byte offset `at` are plausible for the prefix `table`. The first
/// 16,384 event positions must be within twice the duration that the file would have without a
/// table. A table without rows must state a plausible rate, because samples can also have bytes
/// that mean mode 1 and count 0.
fn is_table(
    source: &mut dyn Source,
    header: &Header,
    file_bytes: u64,
    table: TablePrefix,
    at: u64,
) -> Result<bool, RecordingError> {
    if table.count == 0 {
        return Ok(table.states_rate());
    }
    let whole = (file_bytes - header.data_start) / header.record_bytes();
    #[expect(clippy::cast_precision_loss, reason = "records stay below 2^53")]
    let seconds = header.record_duration.map_or(0.0, Ratio::value) * whole as f64;
    let last = 1.0 + 2.0 * seconds * table.rate_or(header.fastest_rate_hz());
    let mut positions = vec![0; in_memory((4 * u64::from(table.count)).min(BLOCK_BYTES))];
    read_at(source, at, &mut positions)?;
    let mut positions =
        positions.chunks_exact(4).map(|position| u32::from_le_bytes(array_at(position, 0)));
    Ok(positions.all(|position| f64::from(position) <= last))
}
