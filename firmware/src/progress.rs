//! Which tasks are alive.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_time::Timer;

use crate::{Shared, deadlines};

/// Counts what each task has done; only that they move matters.
#[derive(Debug)]
pub struct Progress {
    acquired: AtomicU32,
    handed_on: AtomicU32,
    encoded: AtomicU32,
    conversed: AtomicU32,
}

impl Progress {
    /// Nothing done.
    pub const fn new() -> Self {
        Self {
            acquired: AtomicU32::new(0),
            handed_on: AtomicU32::new(0),
            encoded: AtomicU32::new(0),
            conversed: AtomicU32::new(0),
        }
    }

    pub(crate) fn acquired(&self) {
        self.acquired.fetch_add(1, Relaxed);
    }

    /// The encoder has something to do.
    pub(crate) fn handed_on(&self) {
        self.handed_on.fetch_add(1, Relaxed);
    }

    pub(crate) fn encoded(&self) {
        self.encoded.fetch_add(1, Relaxed);
    }

    pub(crate) fn conversed(&self) {
        self.conversed.fetch_add(1, Relaxed);
    }

    fn now(&self) -> Seen {
        Seen {
            acquired: self.acquired.load(Relaxed),
            handed_on: self.handed_on.load(Relaxed),
            encoded: self.encoded.load(Relaxed),
            conversed: self.conversed.load(Relaxed),
        }
    }
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}

/// The counts at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Seen {
    acquired: u32,
    handed_on: u32,
    encoded: u32,
    conversed: u32,
}

impl Seen {
    /// Whether every task has moved since `before`; the encoder need not where nothing was handed on
    /// to it.
    fn all_moved_since(self, before: Self) -> bool {
        self.acquired != before.acquired
            && self.conversed != before.conversed
            && (self.encoded != before.encoded || self.handed_on == before.handed_on)
    }
}

/// Feeds the watchdog while all tasks move, and only then: a hung one lets the device be reset.
pub async fn keep_alive(shared: &Shared, mut feed: impl FnMut()) -> ! {
    let mut before = shared.progress.now();
    loop {
        Timer::after(deadlines::PROGRESS).await;
        let now = shared.progress.now();
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
    fn a_task_that_stands_still_is_seen_and_an_idle_encoder_is_no_task_that_hangs() {
        let progress = Progress::new();
        let start = progress.now();
        progress.acquired();
        assert!(!progress.now().all_moved_since(start), "no conversation");
        progress.conversed();
        assert!(progress.now().all_moved_since(start));
        progress.handed_on();
        assert!(!progress.now().all_moved_since(start), "the encoder hangs");
        progress.encoded();
        assert!(progress.now().all_moved_since(start));
    }
}
