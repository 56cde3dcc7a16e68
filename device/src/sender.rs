//! Numbers messages and queues their frames.

use link::{Encoder, MAX_FRAME, ToHost};

/// Whole frames on their way to the port. It never waits: what it cannot hold, it drops and counts.
pub trait FrameQueue {
    /// Puts a frame at the end.
    fn push(&mut self, frame: &[u8]);

    /// The same with a frame that may not displace others: samples and steps come fast enough to push
    /// out the codes of a host that looks away for a moment.
    fn push_aside(&mut self, frame: &[u8]) {
        self.push(frame);
    }

    /// Counts a frame that was numbered but never pushed.
    fn count_dropped(&mut self);

    /// Frames that were dropped since boot; wraps.
    fn dropped(&self) -> u32;
}

/// Numbers messages and queues their frames, one per device.
#[derive(Clone, Debug)]
pub struct Sender<Q> {
    encoder: Encoder,
    queue: Q,
    buffer: [u8; MAX_FRAME],
}

impl<Q: FrameQueue> Sender<Q> {
    /// A sender whose first frame has `seq` 0.
    pub const fn new(queue: Q) -> Self {
        Self {
            encoder: Encoder::starting_at(0),
            queue,
            buffer: [0; MAX_FRAME],
        }
    }

    /// Queues a message of this device time.
    pub fn send(&mut self, device_time_us: u64, message: &ToHost<'_>) {
        match self
            .encoder
            .encode(device_time_us, message, &mut self.buffer)
        {
            Ok(frame) if is_aside(message) => self.queue.push_aside(frame),
            Ok(frame) => self.queue.push(frame),
            // Numbered but not sendable: the host sees the gap, the count says why.
            Err(_) => self.queue.count_dropped(),
        }
    }

    /// Numbers a message that was lost before it became one, and counts it.
    pub fn skip(&mut self) {
        self.encoder.skip();
        self.queue.count_dropped();
    }

    /// The frames that wait.
    pub const fn queue(&mut self) -> &mut Q {
        &mut self.queue
    }

    /// Frames that were dropped since boot; wraps.
    pub fn dropped(&self) -> u32 {
        self.queue.dropped()
    }
}

/// Whether a message is of those that stream beside the codes and take most of the port.
const fn is_aside(message: &ToHost<'_>) -> bool {
    matches!(
        message,
        ToHost::Raw(_) | ToHost::Filtered(_) | ToHost::Audit(_)
    )
}
