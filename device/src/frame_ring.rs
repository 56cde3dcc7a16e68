//! Whole frames in a ring of bytes.

use crate::FrameQueue;

/// Bytes of a frame's length, in front of it.
const LENGTH: usize = 2;

/// Whole frames that wait for a host, in a ring of `BYTES` bytes. A host that does not read costs the
/// oldest frames, whole, and they are counted; the newest is what a closed loop needs.
#[derive(Clone, Debug)]
pub struct FrameRing<const BYTES: usize> {
    bytes: [u8; BYTES],
    /// Where the oldest frame begins.
    first: usize,
    /// Bytes that are taken.
    used: usize,
    dropped: u32,
}

impl<const BYTES: usize> FrameRing<BYTES> {
    /// An empty ring.
    pub const fn new() -> Self {
        Self {
            bytes: [0; BYTES],
            first: 0,
            used: 0,
            dropped: 0,
        }
    }

    /// True when no frame waits.
    pub const fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Takes the oldest frame out into `frame`, and gives the part that it fills; none when no frame
    /// waits. A frame longer than `frame` is dropped and counted.
    pub fn take<'f>(&mut self, frame: &'f mut [u8]) -> Option<&'f [u8]> {
        while self.used > 0 && self.length() > frame.len() {
            self.forget_oldest();
            self.count_dropped();
        }
        if self.used == 0 {
            return None;
        }
        let frame = &mut frame[..self.length()];
        let (wrapped, up_to_end) = self.bytes.split_at((self.first + LENGTH) % BYTES);
        // What lies before the ring's end, and what lies at its beginning.
        let (head, rest) = frame.split_at_mut(frame.len().min(up_to_end.len()));
        head.copy_from_slice(&up_to_end[..head.len()]);
        rest.copy_from_slice(&wrapped[..rest.len()]);
        self.forget_oldest();
        Some(frame)
    }

    /// Length of the oldest frame.
    fn length(&self) -> usize {
        let bytes = [self.first, self.first + 1].map(|at| self.bytes[at % BYTES]);
        u16::from_le_bytes(bytes).into()
    }

    fn forget_oldest(&mut self) {
        let taken = LENGTH + self.length();
        self.first = (self.first + taken) % BYTES;
        self.used -= taken;
    }

    fn append(&mut self, bytes: &[u8]) {
        let (wrapped, up_to_end) = self.bytes.split_at_mut((self.first + self.used) % BYTES);
        let (head, rest) = bytes.split_at(bytes.len().min(up_to_end.len()));
        up_to_end[..head.len()].copy_from_slice(head);
        wrapped[..rest.len()].copy_from_slice(rest);
        self.used += bytes.len();
    }
}

impl<const BYTES: usize> Default for FrameRing<BYTES> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const BYTES: usize> FrameQueue for FrameRing<BYTES> {
    fn push(&mut self, frame: &[u8]) {
        let length = u16::try_from(frame.len()).ok();
        let Some(length) = length.filter(|_| LENGTH + frame.len() <= BYTES) else {
            self.count_dropped();
            return;
        };
        while self.used + LENGTH + frame.len() > BYTES {
            self.forget_oldest();
            self.count_dropped();
        }
        self.append(&length.to_le_bytes());
        self.append(frame);
    }

    /// Samples may fill three quarters of the ring; what is left is for codes and answers.
    fn push_aside(&mut self, frame: &[u8]) {
        if self.used + LENGTH + frame.len() > BYTES / 4 * 3 {
            self.count_dropped();
        } else {
            self.push(frame);
        }
    }

    fn count_dropped(&mut self) {
        self.dropped = self.dropped.wrapping_add(1);
    }

    fn dropped(&self) -> u32 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use std::{collections::VecDeque, vec::Vec};

    use proptest::prelude::*;

    use super::*;

    #[derive(Clone, Debug)]
    enum Step {
        Push(Vec<u8>),
        Take,
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        let push = prop::collection::vec(any::<u8>(), 0..30).prop_map(Step::Push);
        prop::collection::vec(prop_oneof![2 => push, 1 => Just(Step::Take)], 0..200)
    }

    proptest! {
        #[test]
        fn what_comes_out_is_what_went_in_but_for_the_oldest_that_were_counted(steps in steps()) {
            let mut ring = FrameRing::<64>::new();
            let mut expected: VecDeque<Vec<u8>> = VecDeque::new();
            let mut dropped = 0;
            for step in steps {
                match step {
                    Step::Push(frame) => {
                        ring.push(&frame);
                        expected.push_back(frame);
                        while expected.iter().map(|frame| LENGTH + frame.len()).sum::<usize>() > 64 {
                            expected.pop_front();
                            dropped += 1;
                        }
                    }
                    Step::Take => {
                        let mut buffer = [0; 32];
                        let found = ring.take(&mut buffer).map(<[u8]>::to_vec);
                        prop_assert_eq!(found, expected.pop_front());
                    }
                }
                prop_assert_eq!(ring.dropped(), dropped);
                prop_assert_eq!(ring.is_empty(), expected.is_empty());
            }
        }
    }

    #[test]
    fn samples_displace_no_codes_and_codes_displace_the_oldest() {
        let mut ring = FrameRing::<64>::new();
        for number in 0..9 {
            ring.push_aside(&[number; 10]);
        }
        // Four of 12 bytes fill three quarters.
        assert_eq!(ring.dropped(), 5);
        ring.push(&[100; 10]);
        assert_eq!(ring.dropped(), 5);
        ring.push(&[101; 10]);
        assert_eq!(ring.dropped(), 6);
        let mut buffer = [0; 16];
        let mut firsts = Vec::new();
        while let Some(frame) = ring.take(&mut buffer) {
            firsts.push(frame[0]);
        }
        assert_eq!(firsts, [1, 2, 3, 100, 101]);
    }

    #[test]
    fn a_frame_that_no_ring_holds_is_counted_and_costs_no_other() {
        let mut ring = FrameRing::<16>::new();
        ring.push(&[1; 10]);
        ring.push(&[2; 15]);
        assert_eq!(ring.dropped(), 1);
        assert_eq!(ring.take(&mut [0; 16]), Some(&[1; 10][..]));
        ring.push(&[3; 10]);
        assert_eq!((ring.take(&mut [0; 4]), ring.dropped()), (None, 2));
    }
}
