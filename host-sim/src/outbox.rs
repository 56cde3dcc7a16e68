//! Whole frames on their way to a host that may be slow.

use std::{
    collections::VecDeque,
    io,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

/// What to do when the host does not take frames as fast as they are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenFull {
    /// Drop the oldest whole frames and count them: what a board does, whose time does not wait.
    DropOldest,
    /// Wait for room: for virtual time, which can.
    Wait,
}

/// A bounded queue of frames between the board and the writer of a port.
///
/// Every frame that is pushed is written or counted as dropped, whatever happens.
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
    /// With the time when each was made.
    frames: VecDeque<(Instant, Vec<u8>)>,
    /// A frame was taken and is neither written nor lost yet.
    writing: bool,
    closed: bool,
    dropped: u32,
    failure: Option<io::Error>,
}

/// Frames that wait at most where time can wait: 4 s of codes.
const CAPACITY: usize = 64;

/// How old a frame gets where it cannot. Not a number of frames: then samples on request, of which
/// there are four times as many, would push codes out in a stall that codes alone outlast.
const OLDEST: Duration = Duration::from_secs(4);

/// Frames that wait at most where time cannot: more than 4 s of every stream, 64 raw ones, 32
/// filtered, 16 codes and 5 reports a second; 0.5 MB.
const MOST: usize = 512;

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

    /// What happens when the queue is full.
    pub fn when_full(&self) -> WhenFull {
        self.when_full
    }

    /// Waits until there is room, at most `patience`; true when there is. A queue that drops always
    /// has room.
    pub fn wait_for_room(&self, patience: Duration) -> bool {
        let full = |queue: &Queue| queue.frames.len() >= CAPACITY && !queue.closed;
        self.when_full == WhenFull::DropOldest || self.wait_while(patience, full)
    }

    /// Puts a frame at the end. A queue that drops loses what is older than 4 s; one that waits grows:
    /// wait for room before a frame is made. Frames for a closed outbox count as dropped.
    pub fn push(&self, frame: &[u8]) {
        self.push_at(frame, Instant::now());
    }

    fn push_at(&self, frame: &[u8], now: Instant) {
        let mut queue = self.lock();
        if queue.closed {
            queue.drop_frames(1);
            return;
        }
        if self.when_full == WhenFull::DropOldest {
            queue.make_room(now);
        }
        queue.frames.push_back((now, frame.to_vec()));
        self.shared.changed.notify_all();
    }

    /// The oldest frame, waiting for one; none when the outbox is closed. Follow it by
    /// [`Outbox::written`] or [`Outbox::lost`].
    pub fn take(&self) -> Option<Vec<u8>> {
        let mut queue = self.lock();
        while queue.frames.is_empty() && !queue.closed {
            queue = self
                .shared
                .changed
                .wait(queue)
                .unwrap_or_else(PoisonError::into_inner);
        }
        let frame = queue.frames.pop_front().map(|(_, frame)| frame);
        queue.writing = frame.is_some();
        self.shared.changed.notify_all();
        frame
    }

    /// The frame that was taken is out.
    pub fn written(&self) {
        self.lock().writing = false;
        self.shared.changed.notify_all();
    }

    /// The frame that was taken could not be written, and why; the first reason is kept.
    pub fn lost(&self, reason: io::Error) {
        let mut queue = self.lock();
        // A closed outbox has counted it already.
        if std::mem::take(&mut queue.writing) {
            queue.drop_frames(1);
        }
        queue.failure.get_or_insert(reason);
        self.shared.changed.notify_all();
    }

    /// Frames that were dropped; wraps.
    pub fn dropped(&self) -> u32 {
        self.lock().dropped
    }

    /// Counts a frame that was made but never pushed.
    pub fn count_dropped(&self) {
        self.lock().drop_frames(1);
    }

    /// Why the first frame could not be written, once.
    pub fn failure(&self) -> Option<io::Error> {
        self.lock().failure.take()
    }

    /// Whether the outbox was closed.
    pub fn is_closed(&self) -> bool {
        self.lock().closed
    }

    /// Waits until everything was written, at most `patience`; true when it was.
    pub fn drain(&self, patience: Duration) -> bool {
        self.wait_while(patience, |queue| !queue.frames.is_empty() || queue.writing)
    }

    /// Ends [`Outbox::take`]; what was not written by now counts as dropped.
    pub fn close(&self) {
        let mut queue = self.lock();
        let unsent = queue.frames.len() + usize::from(std::mem::take(&mut queue.writing));
        queue.frames.clear();
        queue.drop_frames(unsent);
        queue.closed = true;
        self.shared.changed.notify_all();
    }

    /// True when the condition ended within `patience`.
    fn wait_while(&self, patience: Duration, condition: impl Fn(&Queue) -> bool) -> bool {
        let deadline = Instant::now() + patience;
        let mut queue = self.lock();
        while condition(&queue) {
            let Some(left) = deadline.checked_duration_since(Instant::now()) else {
                return false;
            };
            let waited = self.shared.changed.wait_timeout(queue, left);
            queue = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        true
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.shared
            .queue
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

impl Queue {
    fn make_room(&mut self, now: Instant) {
        while let Some((made, _)) = self.frames.front()
            && (self.frames.len() >= MOST || now.duration_since(*made) > OLDEST)
        {
            self.frames.pop_front();
            self.drop_frames(1);
        }
    }

    fn drop_frames(&mut self, frames: usize) {
        let frames = u32::try_from(frames).expect("the queue is bounded");
        self.dropped = self.dropped.wrapping_add(frames);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOON: Duration = Duration::from_millis(20);

    #[test]
    fn a_full_outbox_drops_the_oldest_whole_frame_and_counts_it() {
        let outbox = Outbox::new(WhenFull::DropOldest);
        for index in 0..MOST + 3 {
            assert!(outbox.wait_for_room(SOON));
            outbox.push(&index.to_le_bytes());
        }
        assert_eq!(outbox.dropped(), 3);
        assert_eq!(outbox.take(), Some(3_usize.to_le_bytes().to_vec()));
    }

    #[test]
    fn a_stall_of_four_seconds_loses_nothing_however_much_is_streamed_and_a_longer_one_the_oldest()
    {
        let outbox = Outbox::new(WhenFull::DropOldest);
        let begun = Instant::now();
        // Every stream: 117 frames a second.
        for index in 0..6 * 117_u32 {
            outbox.push_at(
                &index.to_le_bytes(),
                begun + index * Duration::from_secs(1) / 117,
            );
            if index == 4 * 117 {
                assert_eq!(outbox.dropped(), 0);
            }
        }
        assert_eq!(outbox.dropped(), 2 * 117 - 1);
        // Codes alone: 16 and 5 reports.
        let outbox = Outbox::new(WhenFull::DropOldest);
        for index in 0..6 * 21_u32 {
            outbox.push_at(
                &index.to_le_bytes(),
                begun + index * Duration::from_secs(1) / 21,
            );
        }
        assert_eq!(outbox.dropped(), 2 * 21 - 1);
    }

    #[test]
    fn virtual_time_waits_for_the_writer_and_loses_nothing() {
        let outbox = Outbox::new(WhenFull::Wait);
        let writer = outbox.clone();
        let received = std::thread::spawn(move || {
            let mut received = Vec::new();
            while let Some(frame) = writer.take() {
                received.push(frame[0]);
                writer.written();
            }
            received
        });
        let sent: Vec<u8> = (0..=255).collect();
        for &byte in &sent {
            assert!(outbox.wait_for_room(Duration::from_secs(10)));
            outbox.push(&[byte]);
        }
        assert!(outbox.drain(Duration::from_secs(10)));
        outbox.close();
        assert_eq!(received.join().expect("the writer ends"), sent);
        assert_eq!(outbox.dropped(), 0);
    }

    #[test]
    fn waiting_for_room_ends_when_nobody_writes() {
        let outbox = Outbox::new(WhenFull::Wait);
        (0..CAPACITY).for_each(|_| outbox.push(b"frame"));
        assert!(!outbox.wait_for_room(SOON));
        assert!(!outbox.drain(SOON));
    }

    #[test]
    fn what_is_queued_or_half_written_when_the_outbox_closes_counts_as_dropped_once() {
        let outbox = Outbox::new(WhenFull::DropOldest);
        (0..5).for_each(|_| outbox.push(b"frame"));
        assert!(outbox.take().is_some());
        outbox.close();
        outbox.lost(io::ErrorKind::BrokenPipe.into());
        outbox.push(b"too late");
        assert_eq!(outbox.dropped(), 6);
        assert_eq!(outbox.take(), None);
        assert!(
            outbox
                .failure()
                .is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe)
        );
    }
}
