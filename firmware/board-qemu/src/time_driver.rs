//! Time driver for embassy-time: the first half of the dual timer is the clock, and timer 0
//! generates the alarms.

use core::{
    cell::{Cell, RefCell},
    task::Waker,
};

use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::Driver as _;
use embassy_time_queue_utils::Queue;

use crate::registers::{CLOCK_HZ, DUAL_TIMER, TIMER0, dual_timer, timer};

/// Ticks of a timer per microsecond.
pub(crate) const TICKS_PER_US: u32 = CLOCK_HZ / 1_000_000;
/// Longest time between two alarms, microseconds. Each alarm reads the free-running timer. The
/// timer wraps every 171 s, and a wrap is counted only if the timer is read before the next wrap.
const LONGEST_US: u64 = 40_000_000;

struct Time {
    /// Last value read from the free-running timer, and number of its wraps so far.
    last: Mutex<Cell<(u32, u32)>>,
    queue: Mutex<RefCell<Queue>>,
}

embassy_time_driver::time_driver_impl!(static TIME: Time = Time {
    last: Mutex::new(Cell::new((0, 0))),
    queue: Mutex::new(RefCell::new(Queue::new())),
});

/// Starts the free-running timer and sets the first alarm.
pub(crate) fn start() {
    DUAL_TIMER.write(dual_timer::LOAD, u32::MAX);
    DUAL_TIMER.write(dual_timer::CONTROL, dual_timer::RUN_FREELY);
    critical_section::with(|section| {
        TIME.arm(section, LONGEST_US, &mut TIME.queue.borrow_ref_mut(section));
    });
}

/// Returns the ticks since [`start`], 32 bits; wraps after 171 s.
#[inline]
pub(crate) fn ticks() -> u32 {
    !DUAL_TIMER.read(dual_timer::VALUE)
}

/// Returns the ticks since [`start`], 64 bits.
pub(crate) fn ticks_since_boot() -> u64 {
    critical_section::with(|section| {
        let now = ticks();
        let (last, wraps) = TIME.last.borrow(section).get();
        let wraps = wraps + u32::from(now < last);
        TIME.last.borrow(section).set((now, wraps));
        u64::from(wraps) << 32 | u64::from(now)
    })
}

/// Wakes the tasks whose alarm is due; called when timer 0 expires.
pub(crate) fn on_alarm() {
    critical_section::with(|section| {
        TIMER0.write(timer::CONTROL, 0);
        TIMER0.write(timer::INTERRUPT, 1);
        let mut queue = TIME.queue.borrow_ref_mut(section);
        let next = queue.next_expiration(TIME.now());
        TIME.arm(section, next, &mut queue);
    });
}

impl embassy_time_driver::Driver for Time {
    fn now(&self) -> u64 {
        ticks_since_boot() / u64::from(TICKS_PER_US)
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|section| {
            let mut queue = self.queue.borrow_ref_mut(section);
            if queue.schedule_wake(at, waker) {
                let next = queue.next_expiration(self.now());
                self.arm(section, next, &mut queue);
            }
        });
    }
}

impl Time {
    /// Sets timer 0 to expire at `next`, in microseconds since boot, but at the latest after
    /// [`LONGEST_US`]. If `next` is in the past, wakes the tasks that are due and takes the next
    /// alarm.
    fn arm(&self, _: CriticalSection<'_>, mut next: u64, queue: &mut Queue) {
        let now = loop {
            let now = self.now();
            if next > now {
                break now;
            }
            next = queue.next_expiration(now);
        };
        let wait_us = u32::try_from((next - now).min(LONGEST_US)).unwrap_or(u32::MAX);
        let ticks = wait_us * TICKS_PER_US;
        TIMER0.write(timer::CONTROL, 0);
        TIMER0.write(timer::INTERRUPT, 1);
        TIMER0.write(timer::RELOAD, 0);
        TIMER0.write(timer::VALUE, ticks);
        TIMER0.write(timer::CONTROL, timer::RUN);
    }
}
