//! Events at a board's inputs: the queue through which the interrupt that captures them passes them
//! to the encoder.

use core::{
    cell::RefCell,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use device::CapturedEvent;
use embassy_sync::blocking_mutex;
use heapless::Deque;
use link::EventKind;

use crate::{deadlines, queues::RawMutex};

type EventQueue = Deque<CapturedEvent, { deadlines::EVENTS_WAITING }>;

/// Queue of captured events that have not been assigned to a sample yet.
pub struct Inputs {
    /// Number of the next event. Events are counted from boot, including lost ones; wraps.
    number: AtomicU32,
    queue: blocking_mutex::Mutex<RawMutex, RefCell<EventQueue>>,
}

impl Inputs {
    pub(crate) const fn new() -> Self {
        Self {
            number: AtomicU32::new(0),
            queue: blocking_mutex::Mutex::new(RefCell::new(Deque::new())),
        }
    }

    /// Queues an event that happened at the device time `at_us`, in microseconds. Called by the
    /// input's interrupt handler. If the queue is full, the event is dropped, which leaves a gap in
    /// the event numbers.
    pub fn push_event(&self, kind: EventKind, at_us: u64) {
        let number = self.number.fetch_add(1, Relaxed);
        // If the queue is full, the number stays used: the gap in the numbers shows the loss.
        let _ = self.with_queue(|queue| queue.push_back(CapturedEvent { kind, number, at_us }));
    }

    /// Skips `events` event numbers, for events that were not captured.
    pub fn count_lost(&self, events: u32) {
        self.number.fetch_add(events, Relaxed);
    }

    pub(crate) fn pop_event(&self) -> Option<CapturedEvent> {
        self.with_queue(Deque::pop_front).flatten()
    }

    /// Drops the events that happened before a run; `start_us` is the device time of the run's
    /// first sample, in microseconds.
    pub(crate) fn discard_before(&self, start_us: u64) {
        self.with_queue(|queue| {
            while queue.front().is_some_and(|event| event.at_us < start_us) {
                queue.pop_front();
            }
        });
    }

    /// Runs `action` on the queue within a critical section. Borrowing the queue cannot fail,
    /// because no `action` calls this function.
    fn with_queue<T>(&self, action: impl FnOnce(&mut EventQueue) -> T) -> Option<T> {
        self.queue.lock(|queue| {
            let mut queue = queue.try_borrow_mut().ok()?;
            Some(action(&mut queue))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_starts_with_the_first_event_at_or_after_its_first_sample() {
        let inputs = Inputs::new();
        for at_us in [10, 19, 20, 21] {
            inputs.push_event(EventKind::TriggerRise, at_us);
        }
        inputs.discard_before(20);
        assert_eq!(inputs.pop_event().map(|event| event.at_us), Some(20));
        assert_eq!(inputs.pop_event().map(|event| event.number), Some(3));
        assert_eq!(inputs.pop_event(), None);
    }

    #[test]
    fn events_come_out_in_order_and_dropped_ones_leave_a_gap_in_the_numbers() {
        let inputs = Inputs::new();
        let more = u32::try_from(deadlines::EVENTS_WAITING).expect("a few") + 3;
        for number in 0..more {
            inputs.push_event(EventKind::TriggerRise, number.into());
        }
        for number in 0..more - 3 {
            assert_eq!(inputs.pop_event().map(|event| event.number), Some(number));
        }
        assert_eq!(inputs.pop_event(), None);
        inputs.count_lost(2);
        inputs.push_event(EventKind::TriggerFall, 99);
        assert_eq!(inputs.pop_event().map(|event| event.number), Some(more + 2));
    }
}
