//! Recordings of the wire: every byte between device and host, with the time at which it was read.
//!
//! ```text
//! port ──bytes──► Recorder: splitter ──records──► file ──► RecordingReader ─┬─► Replayer ──► port
//!                                                                           └─► Playback ──► Core
//! ```
//!
//! `docs/recording-format.md` describes the bytes of a file; a test compares its hex dumps with
//! what this module writes.

pub(crate) mod handshake;
pub(crate) mod introduction;
pub(crate) mod reader;
pub(crate) mod recorder;
pub(crate) mod renumbering;
pub(crate) mod replayer;

use std::io;

use bridge_core::HostTime;
use crc::{CRC_32_ISCSI, Crc};
use link::{MAX_FRAME, Streams};
use thiserror::Error;

/// Reason why a file cannot be used as a recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file does not begin as a recording does. Holds the first bytes, escaped.
    #[error(
        "it is not a recording of corticode-bridge: it starts with \"{0}\"; name a file that \
         `corticode-bridge record` has written"
    )]
    NotARecording(String),
    /// The file is shorter than a recording's header. Holds the length of the file in bytes.
    #[error(
        "it holds only {0} bytes, less than the header of a recording; `corticode-bridge \
         record` was ended before it could write anything"
    )]
    HeaderCutOff(usize),
    /// The header's checksum does not match.
    #[error("its header is damaged (CRC); copy the file again from where it was recorded")]
    HeaderDamaged,
    /// The file's format is newer than this program. Holds the version of the format.
    #[error(
        "it has version {0} of the recording's format, and this program reads versions up to \
         {VERSION}; update corticode-bridge"
    )]
    Version(u16),
    /// The file has no code or sample from a device that has introduced itself.
    #[error(
        "it holds no codes or samples of a device; record again, and check that the device answers; \
         features alone need their --classifier"
    )]
    NoDevice,
    /// The file has nothing that this program can publish. Holds the reason and the remedy.
    #[error("nothing in it can be converted: {0}")]
    NothingUsable(String),
    /// The operating system cannot read the file.
    #[error("it cannot be read; check the path, the permissions and the disk")]
    Read(#[from] io::Error),
}

/// Version of the format that this program writes, and the only one that it reads.
pub(crate) const VERSION: u16 = 1;
/// First bytes of every recording.
const MAGIC: [u8; 8] = *b"CORTIREC";
/// Checksum of header and records: CRC-32C, as in the frames on the wire.
pub(crate) const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Header at the beginning of a recording's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileHeader {
    /// Wall clock when the file was created, nanoseconds since 1970.
    pub created_ns: i64,
    /// Streams that the host asked the device for.
    pub streams: Streams,
    /// Mains frequency that the host asked the device to remove, Hz; 0 if the device chose it.
    pub mains_hz: u8,
}

impl FileHeader {
    /// Length of the header in bytes.
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

    /// Reads a header from the first bytes of a file. `bytes` must hold [`FileHeader::BYTES`]
    /// bytes, unless the file is shorter.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] if this is not the header of a recording that this program can read.
    pub fn decode(bytes: &[u8]) -> Result<FileHeader, RecordingError> {
        let magic = &bytes[..bytes.len().min(MAGIC.len())];
        if !MAGIC.starts_with(magic) {
            let start = magic.escape_ascii().to_string();
            return Err(RecordingError::NotARecording(start));
        }
        let Some(bytes) = bytes.first_chunk::<{ Self::BYTES }>() else {
            return Err(RecordingError::HeaderCutOff(bytes.len()));
        };
        // Check the version first: a newer version may have its checksum at another position.
        let version = u16::from_le_bytes([bytes[8], bytes[9]]);
        if version > VERSION {
            return Err(RecordingError::Version(version));
        }
        let (content, crc) = bytes.split_at(24);
        if CRC.checksum(content).to_le_bytes() != *crc {
            return Err(RecordingError::HeaderDamaged);
        }
        Ok(FileHeader {
            created_ns: i64::from_le_bytes(std::array::from_fn(|index| bytes[16 + index])),
            streams: Streams::from_bits(u16::from_le_bytes([bytes[10], bytes[11]])),
            mains_hz: bytes[12],
        })
    }
}

/// Length of what precedes a record's payload, bytes: length, kind, a zero, two times.
const HEAD: usize = 20;
/// Length of what follows a record's payload, bytes: the CRC.
const TAIL: usize = 4;
/// Length of the longest payload, bytes: a frame, or as many bytes of garbage.
pub(crate) const MAX_PAYLOAD: usize = MAX_FRAME;
/// Length of the longest record, bytes.
pub(crate) const MAX_RECORD: usize = HEAD + MAX_PAYLOAD + TAIL;

/// What happened at the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordKind {
    /// The port was opened.
    Opened,
    /// The port was closed, or was lost.
    Closed,
    /// Bytes came from the device: a frame, or what is left of a damaged frame.
    Received,
    /// A command was sent to the device.
    Sent,
    /// The user ended the recording. The commands and frames after this record stop the device.
    Ending,
    /// The user has marked this moment with a text, which is the payload, in UTF-8.
    Marker,
    /// The device was already streaming when the recording began. The records before this one hold
    /// the device's newest introduction and the commands that it has acknowledged.
    Joined,
    /// A kind of record that only newer programs know. Holds its number.
    Newer(u8),
}

impl RecordKind {
    fn number(self) -> u8 {
        match self {
            RecordKind::Opened => 0,
            RecordKind::Closed => 1,
            RecordKind::Received => 2,
            RecordKind::Sent => 3,
            RecordKind::Ending => 4,
            RecordKind::Marker => 5,
            RecordKind::Joined => 6,
            RecordKind::Newer(number) => number,
        }
    }

    fn from_number(number: u8) -> RecordKind {
        match number {
            0 => RecordKind::Opened,
            1 => RecordKind::Closed,
            2 => RecordKind::Received,
            3 => RecordKind::Sent,
            4 => RecordKind::Ending,
            5 => RecordKind::Marker,
            6 => RecordKind::Joined,
            newer => RecordKind::Newer(newer),
        }
    }
}

/// One record of a recording's file: something that happened at the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'a> {
    /// What happened at the port.
    pub kind: RecordKind,
    /// When it happened. The monotonic clock counts from the start of the host's machine.
    pub time: HostTime,
    /// Bytes that were received or sent, or the text of a marker; empty for other events.
    pub payload: &'a [u8],
}

/// Result of [`Record::parse`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Parsed<'a> {
    /// A whole record, and its length in the file in bytes.
    Whole(Record<'a>, usize),
    /// The bytes may be the beginning of a record; more bytes are needed.
    Incomplete,
    /// The bytes are not the beginning of a record.
    Damaged,
}

impl<'a> Record<'a> {
    /// Appends the record's bytes to `out`, as docs/recording-format.md describes them. The payload
    /// must not be longer than [`MAX_PAYLOAD`].
    pub(crate) fn encode(&self, out: &mut Vec<u8>) {
        debug_assert!(self.payload.len() <= MAX_PAYLOAD);
        let start = out.len();
        let length = u16::try_from(self.payload.len()).unwrap_or(u16::MAX);
        out.extend(length.to_le_bytes());
        out.extend([self.kind.number(), 0]);
        out.extend(self.time.monotonic_us.to_le_bytes());
        out.extend(self.time.wall_ns.to_le_bytes());
        out.extend(self.payload);
        let crc = CRC.checksum(&out[start..]);
        out.extend(crc.to_le_bytes());
    }

    /// Reads the record at the start of `bytes`.
    pub(crate) fn parse(bytes: &'a [u8]) -> Parsed<'a> {
        let Some((head, rest)) = bytes.split_first_chunk::<HEAD>() else {
            return Parsed::Incomplete;
        };
        let [l0, l1, kind, zero, times @ ..] = *head;
        let length = usize::from(u16::from_le_bytes([l0, l1]));
        if length > MAX_PAYLOAD || zero != 0 {
            return Parsed::Damaged;
        }
        let Some((payload, rest)) = rest.split_at_checked(length) else {
            return Parsed::Incomplete;
        };
        let Some(crc) = rest.first_chunk::<TAIL>() else {
            return Parsed::Incomplete;
        };
        if CRC.checksum(&bytes[..HEAD + length]) != u32::from_le_bytes(*crc) {
            return Parsed::Damaged;
        }
        let [m0, m1, m2, m3, m4, m5, m6, m7, wall @ ..] = times;
        let record = Record {
            kind: RecordKind::from_number(kind),
            time: HostTime {
                monotonic_us: i64::from_le_bytes([m0, m1, m2, m3, m4, m5, m6, m7]),
                wall_ns: i64::from_le_bytes(wall),
            },
            payload,
        };
        Parsed::Whole(record, HEAD + length + TAIL)
    }
}

#[cfg(test)]
mod tests {
    use super::{
        FileHeader, HostTime, MAX_PAYLOAD, Parsed, Record, RecordKind, RecordingError, Streams,
    };

    const HEADER: FileHeader =
        FileHeader { created_ns: 1_700_000_000_000_000_000, streams: Streams::ALL, mains_hz: 50 };

    #[test]
    fn a_header_is_read_back_and_other_files_and_damage_have_an_error_each() {
        let whole = HEADER.encode();
        assert_eq!(FileHeader::decode(&whole).unwrap(), HEADER);
        for length in 0..whole.len() {
            let error = FileHeader::decode(&whole[..length]).unwrap_err();
            assert!(matches!(error, RecordingError::HeaderCutOff(_)));
        }
        let mut newer = whole;
        newer[8] = 2;
        let error = FileHeader::decode(&newer).unwrap_err();
        assert!(matches!(error, RecordingError::Version(2)));
        for place in 10..whole.len() {
            let mut damaged = whole;
            damaged[place] ^= 1;
            let error = FileHeader::decode(&damaged).unwrap_err();
            assert!(matches!(error, RecordingError::HeaderDamaged), "{place}");
        }
        let error = FileHeader::decode(b"GDF 2.20").unwrap_err();
        assert!(error.to_string().contains("\"GDF 2.20\""));
    }

    #[test]
    fn a_record_is_read_back_and_each_changed_bit_is_noticed() {
        let payload = [7; MAX_PAYLOAD];
        for length in [0, 1, 166, MAX_PAYLOAD] {
            let record = Record {
                kind: RecordKind::Received,
                time: HostTime { monotonic_us: 12_345_678, wall_ns: -1 },
                payload: &payload[..length],
            };
            let mut bytes = Vec::new();
            record.encode(&mut bytes);
            assert_eq!(Record::parse(&bytes), Parsed::Whole(record, bytes.len()));
            assert_eq!(Record::parse(&bytes[..bytes.len() - 1]), Parsed::Incomplete);
            for bit in 0..bytes.len().min(40) * 8 {
                let mut damaged = bytes.clone();
                damaged[bit / 8] ^= 1 << (bit % 8);
                assert!(!matches!(Record::parse(&damaged), Parsed::Whole(..)));
            }
        }
    }
}
