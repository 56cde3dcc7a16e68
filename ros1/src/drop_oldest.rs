//! A bounded queue that makes room by dropping its oldest item.

use std::{collections::VecDeque, sync::Mutex};

use tokio::sync::Notify;

use crate::lock::lock;

/// Between one who must never wait and one who may be slow. One task takes; any thread puts.
#[derive(Debug)]
pub(crate) struct DropOldest<T> {
    state: Mutex<State<T>>,
    changed: Notify,
    capacity: usize,
}

#[derive(Debug)]
struct State<T> {
    items: VecDeque<T>,
    closed: bool,
}

/// What became of an item.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Put {
    /// It is in the queue.
    Kept,
    /// It is in the queue, and the oldest one is lost.
    DroppedOldest,
    /// The queue is closed; the item is gone.
    Closed,
}

impl<T> DropOldest<T> {
    /// A capacity of 0 is taken as 1: an item must stay somewhere until it is taken.
    pub(crate) fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        let items = VecDeque::with_capacity(capacity.min(1024));
        Self {
            state: Mutex::new(State {
                items,
                closed: false,
            }),
            changed: Notify::new(),
            capacity,
        }
    }

    /// Puts an item in; never waits.
    pub(crate) fn put(&self, item: T) -> Put {
        let outcome = {
            let mut state = lock(&self.state);
            if state.closed {
                return Put::Closed;
            }
            let full = state.items.len() >= self.capacity;
            if full {
                state.items.pop_front();
            }
            state.items.push_back(item);
            if full { Put::DroppedOldest } else { Put::Kept }
        };
        self.changed.notify_one();
        outcome
    }

    /// Takes the oldest item; waits for one. `None` once the queue is closed and empty.
    /// Cancelling loses nothing.
    pub(crate) async fn take(&self) -> Option<T> {
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

    /// Nothing goes in any more; what is in can still be taken.
    pub(crate) fn close(&self) {
        lock(&self.state).closed = true;
        self.changed.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_oldest_goes_first_and_the_rest_keeps_its_order() {
        let queue = DropOldest::new(3);
        let outcomes: Vec<Put> = (0..5).map(|n| queue.put(n)).collect();
        assert_eq!(outcomes[..3], [Put::Kept; 3]);
        assert_eq!(outcomes[3..], [Put::DroppedOldest; 2]);
        queue.close();
        assert_eq!(queue.put(9), Put::Closed);
        let mut left = Vec::new();
        while let Some(item) = queue.take().await {
            left.push(item);
        }
        assert_eq!(left, [2, 3, 4]);
    }

    #[tokio::test]
    async fn who_waits_is_woken() {
        let queue = std::sync::Arc::new(DropOldest::new(1));
        let waiting = tokio::spawn({
            let queue = std::sync::Arc::clone(&queue);
            async move { queue.take().await }
        });
        tokio::task::yield_now().await;
        queue.put(7);
        assert_eq!(waiting.await.unwrap(), Some(7));
    }
}
