//! A lock that can be taken even if it is poisoned, and a bounded queue that drops its oldest item.

use std::{
    collections::VecDeque,
    sync::{Mutex, MutexGuard, PoisonError},
};

use tokio::sync::Notify;

/// Locks `mutex`, even if a thread panicked while holding it. The data in every mutex of this crate
/// is consistent after each statement, so the data can still be used after a panic in one task.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Queue between a producer that must never wait and a consumer that can be slow. Any number of
/// threads can push; only one task may pop.
#[derive(Debug)]
pub(crate) struct DropOldestQueue<T> {
    state: Mutex<State<T>>,
    changed: Notify,
    capacity: usize,
}

#[derive(Debug)]
struct State<T> {
    items: VecDeque<T>,
    closed: bool,
}

/// Outcome of [`DropOldestQueue::push`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Push {
    Queued,
    /// The item is queued; the oldest item was dropped to make room.
    DroppedOldest,
    /// The queue is closed; the item was dropped.
    Closed,
}

impl<T> DropOldestQueue<T> {
    /// Creates a queue for up to `capacity` items. A capacity of 0 is raised to 1, because an item
    /// must be stored until the consumer pops it.
    pub(crate) fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        let items = VecDeque::with_capacity(capacity.min(1024));
        Self { state: Mutex::new(State { items, closed: false }), changed: Notify::new(), capacity }
    }

    /// Number of items that wait to be popped.
    pub(crate) fn len(&self) -> usize {
        lock(&self.state).items.len()
    }

    /// Appends an item without waiting; a full queue drops its oldest item.
    pub(crate) fn push(&self, item: T) -> Push {
        let outcome = {
            let mut state = lock(&self.state);
            if state.closed {
                return Push::Closed;
            }
            let full = state.items.len() >= self.capacity;
            if full {
                state.items.pop_front();
            }
            state.items.push_back(item);
            if full { Push::DroppedOldest } else { Push::Queued }
        };
        self.changed.notify_one();
        outcome
    }

    /// Removes and returns the oldest item. Waits while the queue is empty; returns `None` once the
    /// queue is closed and empty. Cancelling the wait loses no item.
    pub(crate) async fn pop(&self) -> Option<T> {
        loop {
            {
                let mut state = lock(&self.state);
                if let Some(item) = state.items.pop_front() {
                    return Some(item);
                }
                if state.closed {
                    return None;
                }
            }
            self.changed.notified().await;
        }
    }

    /// Closes the queue: later pushes are refused, but items already queued can still be popped.
    pub(crate) fn close(&self) {
        lock(&self.state).closed = true;
        self.changed.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_oldest_item_is_dropped_and_the_others_keep_their_order() {
        let queue = DropOldestQueue::new(3);
        let outcomes: Vec<Push> = (0..5).map(|n| queue.push(n)).collect();
        assert_eq!(outcomes[..3], [Push::Queued; 3]);
        assert_eq!(outcomes[3..], [Push::DroppedOldest; 2]);
        queue.close();
        assert_eq!(queue.push(9), Push::Closed);
        let mut left = Vec::new();
        while let Some(item) = queue.pop().await {
            left.push(item);
        }
        assert_eq!(left, [2, 3, 4]);
    }
}
