//! Split of the wire's bytes into frames, without decoding them.

use crate::recording::record::MAX_PAYLOAD;

/// Splits the bytes from the device at the ends of frames.
///
/// The pieces in their order are all bytes, unchanged. A piece ends with the zero that ends a frame;
/// only garbage longer than a frame, and the bytes before a port was lost, end without one.
#[derive(Debug, Default)]
pub(crate) struct Splitter {
    piece: Vec<u8>,
    /// Whether the piece holds more than the zeros before a frame.
    has_content: bool,
}

impl Splitter {
    /// Adds bytes from the device and passes each piece that they complete to `complete`.
    pub(crate) fn push(&mut self, bytes: &[u8], mut complete: impl FnMut(&[u8])) {
        for &byte in bytes {
            self.piece.push(byte);
            self.has_content |= byte != 0;
            if (byte == 0 && self.has_content) || self.piece.len() == MAX_PAYLOAD {
                complete(&self.piece);
                self.clear();
            }
        }
    }

    /// Passes the bytes of an unfinished piece to `complete`, if there are any.
    pub(crate) fn finish(&mut self, mut complete: impl FnMut(&[u8])) {
        if !self.piece.is_empty() {
            complete(&self.piece);
            self.clear();
        }
    }

    fn clear(&mut self) {
        self.piece.clear();
        self.has_content = false;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{MAX_PAYLOAD, Splitter};

    fn split(chunks: &[Vec<u8>]) -> Vec<Vec<u8>> {
        let mut pieces = Vec::new();
        let mut splitter = Splitter::default();
        for chunk in chunks {
            splitter.push(chunk, |piece| pieces.push(piece.to_vec()));
        }
        splitter.finish(|piece| pieces.push(piece.to_vec()));
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
