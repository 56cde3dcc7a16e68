//! Reads the header of a file of any supported format.

use crate::{
    edf,
    error::RecordingError,
    format::Format,
    gdf,
    header::{HEADER_BLOCK, Header},
    source::{Source, read_at},
};

/// Recognises the format of a file of `file_bytes` bytes and reads its header.
///
/// # Errors
/// [`RecordingError`] if the file is empty, has no known format, or its header cannot be used.
pub(crate) fn read(source: &mut dyn Source, file_bytes: u64) -> Result<Header, RecordingError> {
    let enough = |needed: u64| {
        if file_bytes < needed {
            Err(RecordingError::HeaderTruncated {
                needed,
                found: file_bytes,
            })
        } else {
            Ok(())
        }
    };
    if file_bytes == 0 {
        return Err(RecordingError::Empty);
    }
    let mut magic = [0; 8];
    let magic_bytes = magic
        .len()
        .min(usize::try_from(file_bytes).unwrap_or(usize::MAX));
    read_at(source, 0, &mut magic[..magic_bytes])?;
    let format = Format::detect(magic)?;

    let mut fixed = [0; HEADER_BLOCK];
    enough(HEADER_BLOCK as u64)?;
    read_at(source, 0, &mut fixed)?;
    let is_gdf = matches!(format, Format::Gdf1(_) | Format::Gdf2(_));
    let signals = if is_gdf {
        gdf::signal_count(format, &fixed)?
    } else {
        edf::signal_count(&fixed)?
    };
    // The header has at most 65,536 blocks of 256 bytes, and `enough` checks that the file contains them.
    let header_bytes = HEADER_BLOCK * (1 + signals);
    enough(header_bytes as u64)?;
    let mut bytes = vec![0; header_bytes];
    read_at(source, 0, &mut bytes)?;
    let header = if is_gdf {
        gdf::parse(format, &bytes, signals)?
    } else {
        edf::parse(format, &bytes, signals)?
    };
    enough(header.data_start)?;
    Ok(header)
}
