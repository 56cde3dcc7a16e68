//! Numbers the frames to the host and queues them; the length of the longest one.

use link::{Encoder, ToHost, frame_bytes};
use model::{CELLS, CODE, LABELS, STEPS};

/// Queue of whole frames for the port. It never blocks: when the queue is full, frames are dropped
/// and counted.
pub trait FrameQueue {
    /// Appends a frame; can drop older frames to make room.
    fn push(&mut self, frame: &[u8]);

    /// Appends a frame of a bulk stream, which must not displace other frames. Raw samples and
    /// filtered steps are so frequent that they would displace the codes while the host pauses
    /// briefly.
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
        Self {
            encoder: Encoder::starting_at(0),
            queue,
            buffer: [0; MAX_FRAME],
        }
    }

    /// Numbers, encodes and queues a message. `device_time_us` is the device time for the frame's
    /// header, microseconds since boot.
    pub fn send(&mut self, device_time_us: u64, message: &ToHost<'_>) {
        match self
            .encoder
            .encode(device_time_us, message, &mut self.buffer)
        {
            Ok(frame) if is_bulk(message) => self.queue.push_bulk(frame),
            Ok(frame) => self.queue.push(frame),
            // The message is too long for a frame. The host sees a gap in `seq`, which the counter
            // of dropped frames explains.
            Err(_) => self.queue.count_dropped(),
        }
    }

    /// Skips the `seq` of a message that was lost before encoding, and counts the message as
    /// dropped.
    pub fn skip(&mut self) {
        self.encoder.skip();
        self.queue.count_dropped();
    }

    /// Returns the queue, for the task that writes to the port.
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

/// Bytes of a body with the fields that every message has: header, message number and CRC.
const FRAME_FIELDS: usize = 21;
/// Longest body of the messages whose length does not depend on the model, bytes.
const OTHER_BODIES: usize = 2_048;
/// Longest body of an `Audit`, bytes: model id, window, planes with their length, format, exponent,
/// values.
const AUDIT: usize = FRAME_FIELDS + 8 + 5 + 3 + STEPS * CELLS + 2 + 2 * CODE;
/// Longest body of a `Capabilities`, bytes: rates, dimensions and delays, two texts, scales and
/// zero points.
const CAPABILITIES: usize =
    FRAME_FIELDS + 20 + 2 + LABELS.len() + 2 + link::MAX_TEXT_BYTES + 2 + 4 * CODE + 2 + CODE;

/// Length of the longest frame that a device with this model sends, bytes. [`link::MAX_FRAME`] is
/// that of the largest model.
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
