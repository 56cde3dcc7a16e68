//! What happens at a board's inputs.

use core::{
    cell::RefCell,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use device::CapturedEvent;
use embassy_sync::blocking_mutex;
use heapless::Deque;
use link::EventKind;

use crate::{Mutex, deadlines};

type Waiting = Deque<CapturedEvent, { deadlines::EVENTS_WAITING }>;

/// What was captured at the inputs and not yet placed between samples.
pub struct Inputs {
    /// Events since boot, those that were lost included; wraps.
    number: AtomicU32,
    waiting: blocking_mutex::Mutex<Mutex, RefCell<Waiting>>,
}

impl Inputs {
    pub(crate) const fn new() -> Self {
        Self {
            number: AtomicU32::new(0),
            waiting: blocking_mutex::Mutex::new(RefCell::new(Deque::new())),
        }
    }

    /// Something has happened at this device time; called by the input's interrupt. Where nobody comes
    /// for the events the newest is lost, and the gap in the numbers tells so.
    pub fn captured(&self, kind: EventKind, at_us: u64) {
        let number = self.number.fetch_add(1, Relaxed);
        // Full: counted by its number.
        let _ = self.with(|waiting| {
            waiting.push_back(CapturedEvent {
                kind,
                number,
                at_us,
            })
        });
    }

    /// Events have happened that nobody saw; a gap in the numbers tells so.
    pub fn lost(&self, events: u32) {
        self.number.fetch_add(events, Relaxed);
    }

    pub(crate) fn next(&self) -> Option<CapturedEvent> {
        self.with(Deque::pop_front).flatten()
    }

    /// What happened before a run is of no interest to it; `begin_us` is its first sample's device time.
    pub(crate) fn forget_before(&self, begin_us: u64) {
        self.with(|waiting| {
            while waiting.front().is_some_and(|event| event.at_us < begin_us) {
                waiting.pop_front();
            }
        });
    }

    /// Does something with what waits, alone: nobody else has it, so that it is always done.
    fn with<T>(&self, action: impl FnOnce(&mut Waiting) -> T) -> Option<T> {
        self.waiting.lock(|waiting| {
            let mut waiting = waiting.try_borrow_mut().ok()?;
            Some(action(&mut waiting))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_begins_with_what_happens_from_its_first_sample_on() {
        let inputs = Inputs::new();
        for at_us in [10, 19, 20, 21] {
            inputs.captured(EventKind::TriggerRise, at_us);
        }
        inputs.forget_before(20);
        assert_eq!(inputs.next().map(|event| event.at_us), Some(20));
        assert_eq!(inputs.next().map(|event| event.number), Some(3));
        assert_eq!(inputs.next(), None);
    }

    #[test]
    fn events_come_out_in_order_and_what_does_not_fit_is_a_gap_in_the_numbers() {
        let inputs = Inputs::new();
        let more = u32::try_from(deadlines::EVENTS_WAITING).expect("a few") + 3;
        for number in 0..more {
            inputs.captured(EventKind::TriggerRise, number.into());
        }
        for number in 0..more - 3 {
            assert_eq!(inputs.next().map(|event| event.number), Some(number));
        }
        assert_eq!(inputs.next(), None);
        inputs.lost(2);
        inputs.captured(EventKind::TriggerFall, 99);
        assert_eq!(inputs.next().map(|event| event.number), Some(more + 2));
    }
}
