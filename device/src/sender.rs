//! Numbering and queueing of the frames to the host.

use link::{Encoder, MAX_FRAME, ToHost};

/// A queue of whole frames in front of the port. It never blocks: frames without room are dropped
/// and counted.
pub trait FrameQueue {
    /// Appends a frame; can drop older ones to make room.
    fn push(&mut self, frame: &[u8]);

    /// Appends a frame of a bulk stream, which must not displace others. Raw samples and filtered
    /// steps are so frequent that they would push out the codes while a host pauses briefly.
    fn push_bulk(&mut self, frame: &[u8]) {
        self.push(frame);
    }

    /// Counts a frame that was numbered but never queued.
    fn count_dropped(&mut self);

    /// Returns the number of frames dropped since boot; wraps.
    fn dropped(&self) -> u32;
}

/// Numbers messages, encodes them and queues the frames; a device has one sender.
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

    /// Numbers, encodes and queues a message. `device_time_us`, microseconds since boot, goes into
    /// the frame's header.
    pub fn send(&mut self, device_time_us: u64, message: &ToHost<'_>) {
        match self
            .encoder
            .encode(device_time_us, message, &mut self.buffer)
        {
            Ok(frame) if is_bulk(message) => self.queue.push_bulk(frame),
            Ok(frame) => self.queue.push(frame),
            // The message is too long for a frame: the host sees a gap in `seq`, which the counter
            // of dropped frames explains.
            Err(_) => self.queue.count_dropped(),
        }
    }

    /// Uses up the number of a message that was lost before encoding, and counts it as dropped.
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
        ToHost::Raw(_) | ToHost::Filtered(_) | ToHost::Audit(_)
    )
}
