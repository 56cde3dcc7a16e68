//! One record of a recording: an event at the port, with its time.

use bridge_core::HostTime;
use link::MAX_FRAME;

use crate::recording::file_header::CRC;

/// Bytes of a record before its payload: length, kind, zero, two times.
const HEAD: usize = 20;
/// Bytes of a record after its payload: the CRC.
const TAIL: usize = 4;
/// Longest payload, bytes: a frame, or a stretch of bytes of that length without a zero.
pub(crate) const MAX_PAYLOAD: usize = MAX_FRAME;
/// Longest record, bytes.
pub(crate) const MAX_RECORD: usize = HEAD + MAX_PAYLOAD + TAIL;

/// What happened at the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordKind {
    /// The port was opened.
    Opened,
    /// The port was closed or lost.
    Closed,
    /// Bytes from the device: a frame as it came, or what a damaged line made of it.
    Received,
    /// A command to the device.
    Sent,
    /// The user ended the recording; the commands and frames that follow stop the device.
    Ending,
    /// Something that a newer program has written.
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
            newer => RecordKind::Newer(newer),
        }
    }
}

/// One record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'a> {
    /// What happened.
    pub kind: RecordKind,
    /// When it happened. The monotonic clock counts from the start of the host.
    pub time: HostTime,
    /// Bytes that were received or sent; otherwise empty.
    pub payload: &'a [u8],
}

/// Result of [`Record::parse`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Parsed<'a> {
    /// A whole record and its length in the file, bytes.
    Whole(Record<'a>, usize),
    /// The bytes may be the start of a record.
    Incomplete,
    /// The bytes do not start with a record.
    Damaged,
}

impl<'a> Record<'a> {
    /// Appends the record's bytes, as docs/recording-format.md describes them. A payload has at most
    /// [`MAX_PAYLOAD`] bytes.
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
    use super::{HostTime, MAX_PAYLOAD, Parsed, Record, RecordKind};

    #[test]
    fn a_record_is_read_back_and_each_changed_bit_is_noticed() {
        let payload = [7; MAX_PAYLOAD];
        for length in [0, 1, 166, MAX_PAYLOAD] {
            let record = Record {
                kind: RecordKind::Received,
                time: HostTime {
                    monotonic_us: 12_345_678,
                    wall_ns: -1,
                },
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
