//! The header of a recording.

use crc::{CRC_32_ISCSI, Crc};
use link::Streams;

use crate::recording::error::RecordingError;

/// Version of the format that this program writes, and the only one that it reads.
pub(crate) const VERSION: u16 = 1;
/// First bytes of every recording.
const MAGIC: [u8; 8] = *b"CORTIREC";
/// CRC-32C, the checksum of header and records; the wire's frames use the same.
pub(crate) const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// What a recording states about itself before its first record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileHeader {
    /// Wall clock when the file was created, nanoseconds since 1970.
    pub created_ns: i64,
    /// Streams that the device was asked for.
    pub streams: Streams,
    /// Mains frequency that the device was asked to remove, Hz; 0 if the device chose it.
    pub mains_hz: u8,
}

impl FileHeader {
    /// Length of a header, bytes.
    pub const BYTES: usize = 28;

    /// Returns the header's bytes, as docs/recording-format.md describes them.
    pub fn encode(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[..8].copy_from_slice(&MAGIC);
        bytes[8..10].copy_from_slice(&VERSION.to_le_bytes());
        bytes[10..12].copy_from_slice(&self.streams.bits().to_le_bytes());
        bytes[12] = self.mains_hz;
        bytes[16..24].copy_from_slice(&self.created_ns.to_le_bytes());
        let crc = CRC.checksum(&bytes[..24]);
        bytes[24..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Reads a header from the first bytes of a file; `bytes` is shorter than a header only if the
    /// file is.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] if this is not the header of a recording that this program can read.
    pub fn decode(bytes: &[u8]) -> Result<FileHeader, RecordingError> {
        let magic = &bytes[..bytes.len().min(MAGIC.len())];
        if !MAGIC.starts_with(magic) {
            let found = magic.escape_ascii().to_string();
            return Err(RecordingError::NotARecording { found });
        }
        let Some(bytes) = bytes.first_chunk::<{ Self::BYTES }>() else {
            let bytes = bytes.len();
            return Err(RecordingError::HeaderCutOff { bytes });
        };
        let [
            _,
            _,
            _,
            _,
            _,
            _,
            _,
            _,
            v0,
            v1,
            s0,
            s1,
            mains_hz,
            _,
            _,
            _,
            rest @ ..,
        ] = *bytes;
        // A newer version may place its checksum elsewhere, so the version comes first.
        let found = u16::from_le_bytes([v0, v1]);
        if found > VERSION {
            let newest = VERSION;
            return Err(RecordingError::Version { found, newest });
        }
        let [t0, t1, t2, t3, t4, t5, t6, t7, c0, c1, c2, c3] = rest;
        if CRC.checksum(&bytes[..24]) != u32::from_le_bytes([c0, c1, c2, c3]) {
            return Err(RecordingError::HeaderDamaged);
        }
        Ok(FileHeader {
            created_ns: i64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]),
            streams: Streams::from_bits(u16::from_le_bytes([s0, s1])),
            mains_hz,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{FileHeader, RecordingError, Streams};

    const HEADER: FileHeader = FileHeader {
        created_ns: 1_700_000_000_000_000_000,
        streams: Streams::ALL,
        mains_hz: 50,
    };

    #[test]
    fn a_header_is_read_back() {
        assert_eq!(FileHeader::decode(&HEADER.encode()).unwrap(), HEADER);
    }

    #[test]
    fn other_files_and_damage_have_an_error_each() {
        let whole = HEADER.encode();
        for length in 0..whole.len() {
            let error = FileHeader::decode(&whole[..length]).unwrap_err();
            assert!(matches!(error, RecordingError::HeaderCutOff { .. }));
        }
        let mut newer = whole;
        newer[8] = 2;
        let error = FileHeader::decode(&newer).unwrap_err();
        assert!(matches!(error, RecordingError::Version { found: 2, .. }));
        for place in 10..whole.len() {
            let mut damaged = whole;
            damaged[place] ^= 1;
            let error = FileHeader::decode(&damaged).unwrap_err();
            assert!(matches!(error, RecordingError::HeaderDamaged), "{place}");
        }
        let error = FileHeader::decode(b"GDF 2.20").unwrap_err();
        assert!(error.to_string().contains("\"GDF 2.20\""));
    }
}
