//! Queue of whole frames between a board and a host that can be slow.

use std::{
    collections::VecDeque,
    io,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use link::{FILTERED_STEPS, RAW_SAMPLES};

/// Behaviour when the host reads frames more slowly than the board produces them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhenFull {
    /// In real time: drop the oldest whole frames and count them, as a board does.
    DropOldest,
    /// In virtual time: make the board wait for room.
    Wait,
}

/// A bounded queue of frames between the board and the thread that writes to a port.
///
/// Every queued frame is either written or counted as dropped. Clones share one queue.
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
    /// Frames, oldest first, each with the time at which it was queued.
    frames: VecDeque<(Instant, Vec<u8>)>,
    /// True from [`Outbox::pop`] until the frame is reported as written or lost.
    writing: bool,
    closed: bool,
    dropped: u32,
    /// Number of frames reported as written; wraps.
    written: u32,
    failure: Option<io::Error>,
}

/// Number of codes that the board makes per second.
const CODE_RATE: usize = model::STEP_RATE_HZ as usize / model::HOP;

/// Number of frames per second that report counters, signal quality and the state of the
/// converters.
const REPORT_RATE: usize = 5;

/// Number of frames per second of all streams: raw samples, filtered steps, codes and reports.
const FRAME_RATE: usize = (model::ADC_RATE_HZ as usize).div_ceil(RAW_SAMPLES)
    + (model::STEP_RATE_HZ as usize).div_ceil(FILTERED_STEPS)
    + CODE_RATE
    + REPORT_RATE;

/// Number of queued frames at which the board waits in virtual time: 4 s of codes.
const CAPACITY: usize = 4 * CODE_RATE;

/// Greatest age of a queued frame in real time. The limit is an age, not a number of frames, so
/// that the frequent raw frames do not displace the codes during a pause.
const MAX_AGE: Duration = Duration::from_secs(4);

/// Largest number of queued frames in real time: as many as all streams make in 4.5 s, about 0.5
/// MB, so that [`MAX_AGE`] is reached first.
const MAX_FRAMES: usize = FRAME_RATE * 9 / 2;

impl Outbox {
    /// Creates an empty queue.
    pub fn new(when_full: WhenFull) -> Self {
        let shared = Shared { queue: Mutex::default(), changed: Condvar::new() };
        Self { shared: Arc::new(shared), when_full }
    }

    /// Returns what the outbox does while the host reads too slowly.
    pub fn when_full(&self) -> WhenFull {
        self.when_full
    }

    /// Waits for room in the queue, at most `timeout`, and returns true if there is room. With
    /// [`WhenFull::DropOldest`] there is always room.
    pub fn wait_for_room(&self, timeout: Duration) -> bool {
        let full = |queue: &Queue| queue.frames.len() >= CAPACITY && !queue.closed;
        self.when_full == WhenFull::DropOldest || self.wait_while(timeout, full)
    }

    /// Appends a frame. With [`WhenFull::DropOldest`], drops frames older than 4 s first.
    /// With [`WhenFull::Wait`], the queue can exceed its limit, so call [`Outbox::wait_for_room`]
    /// before making a frame. A closed outbox counts the frame as dropped.
    pub fn push(&self, frame: &[u8]) {
        self.push_at(frame, Instant::now());
    }

    /// Appends a frame as [`Outbox::push`] does, at the time `now`.
    pub(crate) fn push_at(&self, frame: &[u8], now: Instant) {
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

    /// Waits for a frame, then removes and returns the oldest one; `None` if the outbox is closed.
    /// After writing the frame, call [`Outbox::mark_written`] or [`Outbox::mark_lost`].
    pub fn pop(&self) -> Option<Vec<u8>> {
        let changed = &self.shared.changed;
        let has_none = |queue: &mut Queue| queue.frames.is_empty() && !queue.closed;
        let queue = changed.wait_while(self.lock(), has_none);
        let mut queue = queue.unwrap_or_else(PoisonError::into_inner);
        let frame = queue.frames.pop_front().map(|(_, frame)| frame);
        queue.writing = frame.is_some();
        changed.notify_all();
        frame
    }

    /// Removes and returns the oldest frame, without waiting; `None` if there is none.
    #[cfg(feature = "program")]
    pub(crate) fn try_pop(&self) -> Option<Vec<u8>> {
        self.lock().frames.pop_front().map(|(_, frame)| frame)
    }

    /// Removes and returns all queued frames, without waiting, for a caller that reads the board's
    /// frames itself instead of through a port.
    pub fn take_all(&self) -> Vec<Vec<u8>> {
        let frames = self.lock().frames.split_off(0);
        frames.into_iter().map(|(_, frame)| frame).collect()
    }

    /// Reports that the popped frame was written.
    pub fn mark_written(&self) {
        let mut queue = self.lock();
        queue.writing = false;
        queue.written = queue.written.wrapping_add(1);
        drop(queue);
        self.shared.changed.notify_all();
    }

    /// Reports that the popped frame could not be written. The first reason is kept for
    /// [`Outbox::take_failure`].
    pub fn mark_lost(&self, reason: io::Error) {
        let mut queue = self.lock();
        // If `close` has cleared `writing`, `close` has already counted this frame.
        if std::mem::take(&mut queue.writing) {
            queue.drop_frames(1);
        }
        queue.failure.get_or_insert(reason);
        self.shared.changed.notify_all();
    }

    /// Returns the number of frames dropped since creation; wraps.
    pub fn dropped(&self) -> u32 {
        self.lock().dropped
    }

    /// Adds 1 to the number of dropped frames, for a frame that was numbered but never queued.
    pub fn count_dropped(&self) {
        self.lock().drop_frames(1);
    }

    /// Returns whether a frame could not be written because the reader has closed the pipe.
    pub fn reader_has_left(&self) -> bool {
        let queue = self.lock();
        let failure = queue.failure.as_ref().map(io::Error::kind);
        failure == Some(io::ErrorKind::BrokenPipe)
    }

    /// Returns the error of the first frame that could not be written. Returns `None` if there was
    /// no such frame, and from the second call on.
    pub fn take_failure(&self) -> Option<io::Error> {
        self.lock().failure.take()
    }

    /// Returns whether [`Outbox::close`] was called; no frame is sent after that.
    pub fn is_closed(&self) -> bool {
        self.lock().closed
    }

    /// Waits until no frame is queued or being written, at most `timeout`. Returns false if the
    /// time limit expired.
    pub fn drain(&self, timeout: Duration) -> bool {
        self.wait_while(timeout, Queue::is_busy)
    }

    /// Waits until no frame is queued or being written, however long a slow writer takes. Returns
    /// false if it wrote no frame for `stall`.
    pub fn drain_slowly(&self, stall: Duration) -> bool {
        loop {
            let written = self.lock().written;
            if !self.wait_while(stall, |queue| queue.is_busy() && queue.written == written) {
                return false;
            }
            if !self.lock().is_busy() {
                return true;
            }
        }
    }

    /// Closes the outbox: [`Outbox::pop`] returns `None` from now on, and frames that were not
    /// written count as dropped.
    pub fn close(&self) {
        let mut queue = self.lock();
        let unsent = queue.frames.len() + usize::from(std::mem::take(&mut queue.writing));
        queue.frames.clear();
        queue.drop_frames(unsent);
        queue.closed = true;
        self.shared.changed.notify_all();
    }

    /// Waits while `condition` holds, at most `timeout`. Returns false if the time limit expired.
    fn wait_while(&self, timeout: Duration, condition: impl Fn(&Queue) -> bool) -> bool {
        let holds = |queue: &mut Queue| condition(queue);
        let changed = &self.shared.changed;
        let waited = changed.wait_timeout_while(self.lock(), timeout, holds);
        !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out()
    }

    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.shared.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Queue {
    fn is_busy(&self) -> bool {
        !self.frames.is_empty() || self.writing
    }

    fn make_room(&mut self, now: Instant) {
        while let Some((queued, _)) = self.frames.front()
            && (self.frames.len() >= MAX_FRAMES || now.duration_since(*queued) > MAX_AGE)
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
        for index in 0..MAX_FRAMES + 3 {
            assert!(outbox.wait_for_room(SOON));
            outbox.push(&index.to_le_bytes());
        }
        assert_eq!(outbox.dropped(), 3);
        assert_eq!(outbox.pop(), Some(3_usize.to_le_bytes().to_vec()));
    }

    #[test]
    fn a_pause_of_four_seconds_loses_nothing_with_any_streams_and_a_longer_one_the_oldest() {
        for frames_per_second in [FRAME_RATE, CODE_RATE + REPORT_RATE] {
            let outbox = Outbox::new(WhenFull::DropOldest);
            let start = Instant::now();
            let rate = u32::try_from(frames_per_second).expect("some frames");
            for index in 0..6 * rate {
                let at = start + index * Duration::from_secs(1) / rate;
                outbox.push_at(&index.to_le_bytes(), at);
                assert!(index > 4 * rate || outbox.dropped() == 0, "frame {index}");
            }
            assert_eq!(outbox.dropped(), 2 * rate - 1);
        }
    }

    #[test]
    fn in_virtual_time_a_board_that_waits_for_room_loses_no_frame() {
        let outbox = Outbox::new(WhenFull::Wait);
        let writer = outbox.clone();
        let received = std::thread::spawn(move || {
            let next = || writer.pop().inspect(|_| writer.mark_written());
            std::iter::from_fn(next).flatten().collect::<Vec<u8>>()
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
    fn a_slow_writer_is_waited_for_until_it_stalls() {
        let outbox = Outbox::new(WhenFull::Wait);
        (0..5).for_each(|_| outbox.push(b"frame"));
        let writer = outbox.clone();
        // Three frames together take longer than `stall`, but each takes less; the fourth is never
        // written.
        let (pause, stall) = (Duration::from_millis(150), Duration::from_millis(400));
        let thread = std::thread::spawn(move || {
            for _ in 0..3 {
                assert!(writer.pop().is_some());
                std::thread::sleep(pause);
                writer.mark_written();
            }
            assert!(writer.pop().is_some());
        });
        assert!(!outbox.drain_slowly(stall));
        thread.join().expect("it has stalled");
        outbox.close();
        assert_eq!(outbox.dropped(), 2);
        assert!(outbox.drain_slowly(SOON));
    }

    #[test]
    fn waiting_for_room_ends_at_its_time_limit_without_a_writer() {
        let outbox = Outbox::new(WhenFull::Wait);
        (0..CAPACITY).for_each(|_| outbox.push(b"frame"));
        assert!(!outbox.wait_for_room(SOON));
    }

    #[test]
    fn frames_that_are_queued_or_half_written_at_closing_count_as_dropped_once() {
        let outbox = Outbox::new(WhenFull::DropOldest);
        (0..5).for_each(|_| outbox.push(b"frame"));
        assert!(outbox.pop().is_some());
        outbox.close();
        outbox.mark_lost(io::ErrorKind::BrokenPipe.into());
        outbox.push(b"too late");
        assert_eq!(outbox.dropped(), 6);
        assert_eq!(outbox.pop(), None);
        assert!(outbox.reader_has_left());
    }
}
