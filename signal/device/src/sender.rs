//! Sender that numbers the frames to the host and queues them; the ring buffer that is the queue on
//! a board; and the length of the longest frame.

use link::{Encoder, ToHost, frame_bytes};
use model::{CELLS, CODE, LABELS, STEPS};

/// Queue of whole frames for the port. It never blocks: when the queue is full, frames are dropped
/// and counted.
pub trait FrameQueue {
    /// Appends a frame; can drop older frames to make room.
    fn push(&mut self, frame: &[u8]);

    /// Appends a frame of a bulk stream, which must not displace other frames. Raw samples and
    /// filtered steps are so frequent that they would displace the codes during a short pause of
    /// the host.
    fn push_bulk(&mut self, frame: &[u8]) {
        self.push(frame);
    }

    /// Counts a frame that got a `seq` but was not queued.
    fn count_dropped(&mut self);

    /// Returns the number of frames dropped since boot; wraps.
    fn dropped(&self) -> u32;
}

/// Numbers messages, encodes them as frames and queues the frames. A device has one sender, so that
/// `seq` increases by one with every frame.
#[derive(Clone, Debug)]
pub struct Sender<Q> {
    encoder: Encoder,
    queue: Q,
    buffer: [u8; MAX_FRAME],
}

impl<Q: FrameQueue> Sender<Q> {
    /// Creates a sender whose first frame has `seq` 0.
    pub const fn new(queue: Q) -> Self {
        Self { encoder: Encoder::starting_at(0), queue, buffer: [0; MAX_FRAME] }
    }

    /// Numbers, encodes and queues a message. `device_time_us` is the device time for the frame's
    /// header, microseconds since boot.
    pub fn send(&mut self, device_time_us: u64, message: &ToHost<'_>) {
        match self.encoder.encode(device_time_us, message, &mut self.buffer) {
            Ok(frame) if is_bulk(message) => self.queue.push_bulk(frame),
            Ok(frame) => self.queue.push(frame),
            // The message is too long for a frame. The host detects a gap in `seq`, and the counter
            // of dropped frames includes the lost message.
            Err(_) => self.queue.count_dropped(),
        }
    }

    /// Skips the `seq` of a message that was lost before encoding, and counts it as dropped.
    pub fn skip(&mut self) {
        self.encoder.skip();
        self.queue.count_dropped();
    }

    /// Returns the queue of frames, for the task that writes them to the port.
    pub const fn queue(&mut self) -> &mut Q {
        &mut self.queue
    }

    /// Returns the number of frames dropped since boot; wraps.
    pub fn dropped(&self) -> u32 {
        self.queue.dropped()
    }
}

/// Returns true for the messages that take most of the port's bandwidth.
const fn is_bulk(message: &ToHost<'_>) -> bool {
    matches!(
        message,
        ToHost::Raw(_) | ToHost::CompressedRaw(_) | ToHost::Filtered(_) | ToHost::Audit(_)
    )
}

/// Length of the fields that every body has, bytes: header, message number and CRC.
const FRAME_FIELDS: usize = 21;
/// Length of the longest body that does not depend on the model, bytes.
const OTHER_BODIES: usize = 2_048;
/// Length of the longest `Audit` body, bytes: model id, window, planes with their length, format,
/// exponent, values.
const AUDIT: usize = FRAME_FIELDS + 8 + 5 + 3 + STEPS * CELLS + 2 + 2 * CODE;
/// Length of the longest `Capabilities` body, bytes: rates, dimensions and delays, two texts,
/// scales and zero points.
const CAPABILITIES: usize =
    FRAME_FIELDS + 20 + 2 + LABELS.len() + 2 + link::MAX_TEXT_BYTES + 2 + 4 * CODE + 2 + CODE;

/// Length of the longest frame that a device with this model sends, bytes. [`link::MAX_FRAME`] is
/// the length for the largest model that the wire format allows.
pub const MAX_FRAME: usize = {
    let mut longest = OTHER_BODIES;
    if AUDIT > longest {
        longest = AUDIT;
    }
    if CAPABILITIES > longest {
        longest = CAPABILITIES;
    }
    frame_bytes(longest)
};

const _: () = assert!(MAX_FRAME <= link::MAX_FRAME);

/// Size of the length field in front of each frame, bytes.
const LENGTH: usize = 2;

/// Queue of whole frames in a ring buffer of `BYTES` bytes, for the port to the host.
///
/// If the ring is full, it drops and counts its oldest frames, because a host that reacts to the
/// codes needs the newest ones.
#[derive(Clone, Debug)]
pub struct FrameRing<const BYTES: usize> {
    bytes: [u8; BYTES],
    /// Offset of the oldest frame in `bytes`.
    first: usize,
    /// Number of bytes in use, length fields included.
    used: usize,
    dropped: u32,
}

impl<const BYTES: usize> FrameRing<BYTES> {
    /// Creates an empty ring; usable in a `static`.
    pub const fn new() -> Self {
        Self { bytes: [0; BYTES], first: 0, used: 0, dropped: 0 }
    }

    /// Removes the oldest frame from the ring, copies it to the start of the buffer `frame` and
    /// returns the part written; `None` if no frame waits. A frame longer than the buffer is
    /// dropped and counted.
    pub fn pop<'f>(&mut self, frame: &'f mut [u8]) -> Option<&'f [u8]> {
        while self.used > 0 && self.length() > frame.len() {
            self.discard_oldest();
            self.count_dropped();
        }
        if self.used == 0 {
            return None;
        }
        let frame = &mut frame[..self.length()];
        let (wrapped, up_to_end) = self.bytes.split_at((self.first + LENGTH) % BYTES);
        // A frame can wrap around the end of the ring: `head` is its part before the end, `rest`
        // its part from the start of the ring.
        let (head, rest) = frame.split_at_mut(frame.len().min(up_to_end.len()));
        head.copy_from_slice(&up_to_end[..head.len()]);
        rest.copy_from_slice(&wrapped[..rest.len()]);
        self.discard_oldest();
        Some(frame)
    }

    /// Returns the length of the oldest frame in bytes, as its length field states.
    fn length(&self) -> usize {
        let bytes = [self.first, self.first + 1].map(|at| self.bytes[at % BYTES]);
        u16::from_le_bytes(bytes).into()
    }

    fn discard_oldest(&mut self) {
        let bytes = LENGTH + self.length();
        self.first = (self.first + bytes) % BYTES;
        self.used -= bytes;
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
            self.discard_oldest();
            self.count_dropped();
        }
        self.append(&length.to_le_bytes());
        self.append(frame);
    }

    /// Drops a bulk frame that would fill the ring beyond three quarters; the last quarter is
    /// reserved for codes and answers.
    fn push_bulk(&mut self, frame: &[u8]) {
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
    enum Operation {
        Push(Vec<u8>),
        Pop,
    }

    fn operations() -> impl Strategy<Value = Vec<Operation>> {
        let push = prop::collection::vec(any::<u8>(), 0..30).prop_map(Operation::Push);
        prop::collection::vec(prop_oneof![2 => push, 1 => Just(Operation::Pop)], 0..200)
    }

    proptest! {
        #[test]
        fn frames_come_out_in_order_except_the_oldest_which_are_counted(operations in operations()) {
            let mut ring = FrameRing::<64>::new();
            let mut expected: VecDeque<Vec<u8>> = VecDeque::new();
            let mut dropped = 0;
            for operation in operations {
                match operation {
                    Operation::Push(frame) => {
                        ring.push(&frame);
                        expected.push_back(frame);
                        while expected.iter().map(|frame| LENGTH + frame.len()).sum::<usize>() > 64 {
                            expected.pop_front();
                            dropped += 1;
                        }
                    }
                    Operation::Pop => {
                        let mut buffer = [0; 32];
                        let found = ring.pop(&mut buffer).map(<[u8]>::to_vec);
                        prop_assert_eq!(found, expected.pop_front());
                    }
                }
                prop_assert_eq!(ring.dropped(), dropped);
            }
        }
    }

    #[test]
    fn bulk_frames_displace_none_and_others_displace_the_oldest() {
        let mut ring = FrameRing::<64>::new();
        for number in 0..9 {
            ring.push_bulk(&[number; 10]);
        }
        // Three quarters of the ring are 48 bytes, enough for four of the nine bulk frames: each
        // takes 12 bytes with its length field.
        assert_eq!(ring.dropped(), 5);
        ring.push(&[100; 10]);
        assert_eq!(ring.dropped(), 5);
        ring.push(&[101; 10]);
        assert_eq!(ring.dropped(), 6);
        let mut buffer = [0; 16];
        let mut firsts = Vec::new();
        while let Some(frame) = ring.pop(&mut buffer) {
            firsts.push(frame[0]);
        }
        assert_eq!(firsts, [1, 2, 3, 100, 101]);
    }

    #[test]
    fn a_frame_longer_than_the_ring_is_counted_and_displaces_none() {
        let mut ring = FrameRing::<16>::new();
        ring.push(&[1; 10]);
        ring.push(&[2; 15]);
        assert_eq!(ring.dropped(), 1);
        assert_eq!(ring.pop(&mut [0; 16]), Some(&[1; 10][..]));
        ring.push(&[3; 10]);
        assert_eq!((ring.pop(&mut [0; 4]), ring.dropped()), (None, 2));
    }
}
