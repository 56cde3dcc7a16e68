//! Determines the number of records in a GDF file whose header states -1 records.

use super::events::{PREFIX, TablePrefix};
use crate::{
    error::RecordingError,
    header::{Header, array_at},
    ratio::Ratio,
    source::{BLOCK_BYTES, Source, in_memory, read_at},
};

/// Size of the longest event table that is searched for, bytes: 2^24 - 1 rows (the limit of GDF 2) of
/// 12 bytes in mode 3.
const TABLE_MAX: u64 = PREFIX as u64 + 12 * 0x00ff_ffff;

/// Returns the number of records before an event table that ends exactly at the end of the file; `None`
/// if there is no table and all bytes after the header are records.
///
/// No field of the file states where the records end. The function therefore tests the end of every
/// record in the last [`TABLE_MAX`] bytes, from the last record backwards, for the prefix of an event
/// table. The mode and count of the prefix must yield the remaining length of the file. Samples can
/// fulfil this by chance, so [`is_table`] checks the columns too.
///
/// # Errors
/// [`RecordingError::Read`] if reading fails.
pub(crate) fn before_table(
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
                && is_table(
                    source,
                    header,
                    file_bytes,
                    table,
                    header.data_start + columns,
                )?
            {
                return Ok(Some(records));
            }
        }
        end = start;
    }
    Ok(None)
}

/// Returns whether the columns at byte offset `at` are plausible for the prefix `table`. The first
/// 16,384 event positions must be within twice the duration that the file would have without a table. A
/// table without rows must state its rate; otherwise samples whose bytes equal mode 1 and count 0 would
/// be taken for a table.
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
    let mut positions = positions
        .chunks_exact(4)
        .map(|position| u32::from_le_bytes(array_at(position, 0)));
    Ok(positions.all(|position| f64::from(position) <= last))
}
