//! Turns what happens at a port into the bytes of a recording.

use bridge_core::HostTime;

use crate::recording::{FileHeader, MAX_PAYLOAD, Record, RecordKind};

/// Turns what happens at a port into records. Pure: the caller writes the bytes that
/// [`Recorder::take`] returns to a file.
///
/// The bytes from the device are split after each zero that ends a frame, and become the payloads
/// of records. Joined in order, the payloads are exactly the bytes from the device. A payload ends
/// without a zero only if it holds an unfinished frame, or garbage that is longer than a frame.
#[derive(Debug)]
pub struct Recorder {
    /// Bytes received so far of the frame that is not complete yet.
    piece: Vec<u8>,
    /// Whether `piece` holds a byte other than the zeros that can precede a frame.
    has_content: bool,
    unwritten: Vec<u8>,
    bytes: u64,
}

impl Recorder {
    /// Creates a recorder. The first bytes that it returns are the header of the file.
    pub fn new(header: FileHeader) -> Recorder {
        Recorder {
            piece: Vec::new(),
            has_content: false,
            unwritten: header.encode().to_vec(),
            bytes: FileHeader::BYTES as u64,
        }
    }

    /// Records that the port was opened.
    pub fn opened(&mut self, now: HostTime) {
        self.append(RecordKind::Opened, now, &[]);
    }

    /// Records the bytes of an unfinished frame, if any, and then that the port was closed or lost.
    pub fn closed(&mut self, now: HostTime) {
        self.finish_piece(now);
        self.append(RecordKind::Closed, now, &[]);
    }

    /// Records bytes from the device that were read at `read`. A frame is recorded when its last
    /// byte arrives, with the time of this byte.
    pub fn received(&mut self, bytes: &[u8], read: HostTime) {
        for &byte in bytes {
            self.piece.push(byte);
            self.has_content |= byte != 0;
            if (byte == 0 && self.has_content) || self.piece.len() == MAX_PAYLOAD {
                self.finish_piece(read);
            }
        }
    }

    /// Records a command that was sent to the device.
    pub fn sent(&mut self, frame: &[u8], now: HostTime) {
        self.append(RecordKind::Sent, now, frame);
    }

    /// Records that the user ended the recording.
    pub fn ending(&mut self, now: HostTime) {
        self.append(RecordKind::Ending, now, &[]);
    }

    /// Records a text with which the user has marked this moment. A text that is longer than the
    /// longest payload is cut off.
    pub fn marker(&mut self, text: &str, now: HostTime) {
        let end = text.floor_char_boundary(MAX_PAYLOAD);
        self.append(RecordKind::Marker, now, &text.as_bytes()[..end]);
    }

    /// Records that the device was already streaming when the recording began.
    pub(crate) fn joined(&mut self, now: HostTime) {
        self.append(RecordKind::Joined, now, &[]);
    }

    /// Records the bytes of an unfinished frame, if there are any.
    pub fn finish_piece(&mut self, now: HostTime) {
        let mut piece = std::mem::take(&mut self.piece);
        if !piece.is_empty() {
            self.append(RecordKind::Received, now, &piece);
        }
        piece.clear();
        self.piece = piece;
        self.has_content = false;
    }

    /// Returns the bytes that were recorded since the last call: whole records. The first call also
    /// returns the header, in front of them.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.unwritten)
    }

    /// Returns the number of bytes recorded so far, including the header.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    fn append(&mut self, kind: RecordKind, time: HostTime, payload: &[u8]) {
        let before = self.unwritten.len();
        let record = Record { kind, time, payload };
        record.encode(&mut self.unwritten);
        self.bytes += (self.unwritten.len() - before) as u64;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{FileHeader, HostTime, MAX_PAYLOAD, Recorder};
    use crate::recording::reader::RecordingReader;

    /// Records each of `chunks` as one read from a device. Returns the records' payloads.
    fn split(chunks: &[Vec<u8>]) -> Vec<Vec<u8>> {
        let time = HostTime { monotonic_us: 0, wall_ns: 0 };
        let mut recorder = Recorder::new(FileHeader {
            created_ns: 0,
            streams: link::Streams::empty(),
            mains_hz: 0,
        });
        for chunk in chunks {
            recorder.received(chunk, time);
        }
        recorder.finish_piece(time);
        let file = recorder.take();
        let mut reader = RecordingReader::new(&file[..]).unwrap();
        let mut pieces = Vec::new();
        while let Some(record) = reader.next_record().unwrap() {
            pieces.push(record.payload.to_vec());
        }
        pieces
    }

    #[test]
    fn a_frame_keeps_both_of_its_zeros() {
        let chunks = [vec![0, 1, 2], vec![3, 0, 0, 4], vec![0, 5]];
        let pieces: [&[u8]; 3] = [&[0, 1, 2, 3, 0], &[0, 4, 0], &[5]];
        assert_eq!(split(&chunks), pieces);
    }

    #[test]
    fn garbage_without_a_zero_is_split_at_the_longest_payload() {
        let pieces = split(&[vec![9; 2 * MAX_PAYLOAD + 5]]);
        let lengths: Vec<usize> = pieces.iter().map(Vec::len).collect();
        assert_eq!(lengths, [MAX_PAYLOAD, MAX_PAYLOAD, 5]);
    }

    proptest! {
        #[test]
        fn no_byte_is_lost_or_changed(chunks: Vec<Vec<u8>>) {
            prop_assert_eq!(split(&chunks).concat(), chunks.concat());
        }
    }
}
