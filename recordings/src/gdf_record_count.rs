//! How many records a GDF file has when its header leaves it open (-1).

use crate::{
    Ratio, RecordingError,
    gdf_events::{PREFIX, TablePrefix},
    header::{Header, array_at},
    source::{BLOCK_BYTES, Source, in_memory, read_at},
};

/// The longest table that is looked for, bytes: 2^24 - 1 rows, what GDF 2 can count, in mode 3.
const TABLE_MAX: u64 = PREFIX as u64 + 12 * 0x00ff_ffff;

/// Records in front of an event table that ends exactly where the file does; `None` when there
/// is no such table, so that everything behind the header is records.
///
/// Nothing else says where the records end, so every place where one could end is looked at, the
/// last first: at most [`TABLE_MAX`] bytes are read, in blocks. Four bytes of a table name its
/// length; samples that do so by chance are told from it by what follows, see [`is_table`].
///
/// # Errors
/// [`RecordingError::Read`].
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
        let begin = end.saturating_sub(per_block).max(first);
        bytes.resize(in_memory((end - 1 - begin) * record_bytes) + PREFIX, 0);
        read_at(source, header.data_start + begin * record_bytes, &mut bytes)?;
        for records in (begin..end).rev() {
            let at = in_memory((records - begin) * record_bytes);
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
        end = begin;
    }
    Ok(None)
}

/// Whether the columns at byte `at` can be those of `table`: positions (the first 16,384 are
/// looked at) lie within twice the length that the file could have without a table; a table
/// without rows has to state its rate, or a signal that fades to 1, 0, 0, 0 would be one.
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
