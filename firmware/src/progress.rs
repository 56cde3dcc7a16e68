//! Progress of the tasks, which decides whether the watchdog is fed.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_time::Timer;

use crate::deadlines;

/// One wrapping counter for each task, and one for the samples that the encoder must process. A
/// task makes progress when its counter changes; the value itself has no meaning.
#[derive(Debug)]
pub struct Progress {
    acquired: AtomicU32,
    handed_over: AtomicU32,
    encoded: AtomicU32,
    conversed: AtomicU32,
}

impl Progress {
    pub(crate) const fn new() -> Self {
        Self {
            acquired: AtomicU32::new(0),
            handed_over: AtomicU32::new(0),
            encoded: AtomicU32::new(0),
            conversed: AtomicU32::new(0),
        }
    }

    pub(crate) fn mark_acquired(&self) {
        self.acquired.fetch_add(1, Relaxed);
    }

    /// Records that the acquisition has a sample for the encoder, even if the queue is full.
    pub(crate) fn mark_handed_over(&self) {
        self.handed_over.fetch_add(1, Relaxed);
    }

    pub(crate) fn mark_encoded(&self) {
        self.encoded.fetch_add(1, Relaxed);
    }

    pub(crate) fn mark_conversed(&self) {
        self.conversed.fetch_add(1, Relaxed);
    }

    fn snapshot(&self) -> Snapshot {
        Snapshot {
            acquired: self.acquired.load(Relaxed),
            handed_over: self.handed_over.load(Relaxed),
            encoded: self.encoded.load(Relaxed),
            conversed: self.conversed.load(Relaxed),
        }
    }
}

/// Values of all progress counters at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Snapshot {
    acquired: u32,
    handed_over: u32,
    encoded: u32,
    conversed: u32,
}

impl Snapshot {
    /// Returns whether every task has made progress since `before`. The encoder need not have made
    /// progress if no sample was handed to it.
    fn all_moved_since(self, before: Self) -> bool {
        self.acquired != before.acquired
            && self.conversed != before.conversed
            && (self.encoded != before.encoded || self.handed_over == before.handed_over)
    }
}

/// Checks the tasks after every period of [`deadlines::PROGRESS`], and calls `feed` if all of them
/// have made progress in that period. If a task hangs, `feed` is not called and the watchdog
/// expires.
pub async fn keep_alive(progress: &Progress, mut feed: impl FnMut()) -> ! {
    let mut before = progress.snapshot();
    loop {
        Timer::after(deadlines::PROGRESS).await;
        let now = progress.snapshot();
        if now.all_moved_since(before) {
            feed();
        }
        before = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hung_task_is_detected_and_an_idle_encoder_does_not_count_as_hung() {
        let progress = Progress::new();
        let start = progress.snapshot();
        progress.mark_acquired();
        assert!(!progress.snapshot().all_moved_since(start), "no conversation");
        progress.mark_conversed();
        assert!(progress.snapshot().all_moved_since(start));
        progress.mark_handed_over();
        assert!(!progress.snapshot().all_moved_since(start), "the encoder hangs");
        progress.mark_encoded();
        assert!(progress.snapshot().all_moved_since(start));
    }
}
