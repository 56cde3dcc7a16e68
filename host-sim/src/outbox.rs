//! Whole frames on their way to a host that may be slow.

use std::{
    collections::VecDeque,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

/// What to do when the host does not take frames as fast as they are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenFull {
    /// Drop the oldest whole frame and count it: what a board does, whose time does not wait.
    DropOldest,
    /// Wait for room: for virtual time, which can.
    Wait,
}

/// A bounded queue of frames between the board and the writer of a port.
#[derive(Clone, Debug)]
pub struct Outbox {
    shared: Arc<Shared>,
    when_full: WhenFull,
}

#[derive(Debug)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Queue {
    frames: VecDeque<Vec<u8>>,
    /// A frame was taken and its bytes may not be out yet.
    writing: bool,
    closed: bool,
    dropped: u32,
}

/// Frames that wait at most: 4 s of codes.
const CAPACITY: usize = 64;

impl Outbox {
    /// An empty queue.
    pub fn new(when_full: WhenFull) -> Self {
        let shared = Shared {
            queue: Mutex::default(),
            changed: Condvar::new(),
        };
        Self {
            shared: Arc::new(shared),
            when_full,
        }
    }

    /// Puts a frame at the end. Frames for a closed outbox count as dropped.
    pub fn push(&self, frame: &[u8]) {
        let mut queue = self.lock();
        while self.when_full == WhenFull::Wait && queue.frames.len() >= CAPACITY && !queue.closed {
            queue = self.wait(queue);
        }
        if queue.closed {
            queue.dropped = queue.dropped.wrapping_add(1);
            return;
        }
        if queue.frames.len() >= CAPACITY {
            queue.frames.pop_front();
            queue.dropped = queue.dropped.wrapping_add(1);
        }
        queue.frames.push_back(frame.to_vec());
        self.shared.changed.notify_all();
    }

    /// The oldest frame, waiting for one; none when the outbox is closed and empty.
    pub fn take(&self) -> Option<Vec<u8>> {
        let mut queue = self.lock();
        queue.writing = false;
        self.shared.changed.notify_all();
        while queue.frames.is_empty() && !queue.closed {
            queue = self.wait(queue);
        }
        let frame = queue.frames.pop_front();
        queue.writing = frame.is_some();
        self.shared.changed.notify_all();
        frame
    }

    /// Counts a frame that was taken but could not be written.
    pub fn lost(&self) {
        let mut queue = self.lock();
        queue.dropped = queue.dropped.wrapping_add(1);
    }

    /// Frames that were dropped; wraps.
    pub fn dropped(&self) -> u32 {
        self.lock().dropped
    }

    /// Waits until everything was written, at most `patience`; true when it was.
    pub fn drain(&self, patience: Duration) -> bool {
        let deadline = Instant::now() + patience;
        let mut queue = self.lock();
        while !queue.frames.is_empty() || queue.writing {
            let Some(left) = deadline.checked_duration_since(Instant::now()) else {
                return false;
            };
            let waited = self.shared.changed.wait_timeout(queue, left);
            queue = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        true
    }

    /// Ends [`Outbox::take`] once the queue is empty.
    pub fn close(&self) {
        self.lock().closed = true;
        self.shared.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.shared
            .queue
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'q>(&self, queue: MutexGuard<'q, Queue>) -> MutexGuard<'q, Queue> {
        self.shared
            .changed
            .wait(queue)
            .unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_outbox_drops_the_oldest_whole_frame_and_counts_it() {
        let outbox = Outbox::new(WhenFull::DropOldest);
        for index in 0..CAPACITY + 3 {
            outbox.push(&index.to_le_bytes());
        }
        assert_eq!(outbox.dropped(), 3);
        assert_eq!(outbox.take(), Some(3_usize.to_le_bytes().to_vec()));
    }

    #[test]
    fn virtual_time_waits_for_the_writer_and_loses_nothing() {
        let outbox = Outbox::new(WhenFull::Wait);
        let reader = outbox.clone();
        let received = std::thread::spawn(move || {
            std::iter::from_fn(|| reader.take())
                .map(|frame| frame[0])
                .collect::<Vec<u8>>()
        });
        let sent: Vec<u8> = (0..=255).collect();
        for &byte in &sent {
            outbox.push(&[byte]);
        }
        assert!(outbox.drain(Duration::from_secs(10)));
        outbox.close();
        assert_eq!(received.join().expect("the reader ends"), sent);
        assert_eq!(outbox.dropped(), 0);
    }
}
