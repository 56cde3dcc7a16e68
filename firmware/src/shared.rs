//! What tasks of different priorities tell each other beside samples and codes.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use device::{Counts, Order};
use embassy_sync::{blocking_mutex::raw::CriticalSectionRawMutex, signal::Signal};

use link::{Converters, SelfTest};

use crate::{Clock, Inputs, Progress, timing::Timing};

/// Guards what tasks of different priorities share.
pub type Mutex = CriticalSectionRawMutex;

/// Orders and counts. Counts have one writer each.
pub struct Shared {
    /// What the acquisition has to do; a newer order replaces one that was not obeyed yet.
    pub(crate) orders: Signal<Mutex, Order>,
    samples: [AtomicU32; 2],
    overruns: AtomicU32,
    adc_status_bad: AtomicU32,
    clipped: AtomicU32,
    /// Codes and reports for which the conversation had no room.
    pub(crate) made_lost: AtomicU32,
    /// What happens at the board's inputs.
    pub inputs: Inputs,
    /// How the converters are, once the acquisition has looked.
    pub(crate) converters: Signal<Mutex, Converters>,
    /// The result of a self-test that was ordered.
    pub(crate) self_test: Signal<Mutex, SelfTest>,
    /// How long each stage takes.
    pub(crate) timing: Timing,
    /// Which tasks have moved.
    pub(crate) progress: Progress,
}

impl Shared {
    /// No order, nothing counted; times by this clock.
    pub const fn new(clock: Clock) -> Self {
        Self {
            orders: Signal::new(),
            samples: [const { AtomicU32::new(0) }; 2],
            overruns: AtomicU32::new(0),
            adc_status_bad: AtomicU32::new(0),
            clipped: AtomicU32::new(0),
            made_lost: AtomicU32::new(0),
            inputs: Inputs::new(),
            converters: Signal::new(),
            self_test: Signal::new(),
            timing: Timing::new(clock),
            progress: Progress::new(),
        }
    }

    /// Gives an order that no host has given.
    pub fn order(&self, order: Order) {
        self.orders.signal(order);
    }

    /// What the acquisition has counted since boot.
    pub fn counts(&self) -> Counts {
        // The acquisition is more urgent than any reader: a carry between the halves shows.
        let [high, low] = loop {
            let high = self.samples[1].load(Relaxed);
            let low = self.samples[0].load(Relaxed);
            if high == self.samples[1].load(Relaxed) {
                break [high, low];
            }
        };
        Counts {
            samples: u64::from(high) << 32 | u64::from(low),
            overruns: self.overruns.load(Relaxed),
            adc_status_bad: self.adc_status_bad.load(Relaxed),
            clipped: self.clipped.load(Relaxed),
        }
    }

    pub(crate) fn count_sample(&self) {
        if self.samples[0].fetch_add(1, Relaxed) == u32::MAX {
            self.samples[1].fetch_add(1, Relaxed);
        }
    }

    pub(crate) fn count_overruns(&self, overruns: u32) {
        self.overruns.fetch_add(overruns, Relaxed);
    }

    pub(crate) fn count_adc_status_bad(&self) {
        self.adc_status_bad.fetch_add(1, Relaxed);
    }

    pub(crate) fn count_clipped(&self, clipped: u16) {
        self.clipped.fetch_add(clipped.into(), Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use device::Run;
    use link::Streams;

    use super::*;

    fn shared() -> Shared {
        Shared::new(Clock {
            now: || 0,
            hz: 1_000_000,
        })
    }

    #[test]
    fn a_newer_order_displaces_one_that_was_not_obeyed_yet() {
        let shared = shared();
        let run = |number| {
            Order::Start(Run {
                number,
                streams: Streams::CODES,
                ..Run::NONE
            })
        };
        shared.order(run(1));
        shared.order(Order::Stop);
        assert_eq!(shared.orders.try_take(), Some(Order::Stop));
        assert_eq!(shared.orders.try_take(), None);
        for order in [Order::Stop, run(2), run(3)] {
            shared.order(order);
        }
        assert_eq!(shared.orders.try_take(), Some(run(3)));
        assert_eq!(shared.orders.try_take(), None);
    }

    #[test]
    fn samples_are_counted_in_64_bits_and_the_other_counts_wrap() {
        let shared = shared();
        shared.samples[0].store(u32::MAX, Relaxed);
        shared.overruns.store(u32::MAX, Relaxed);
        shared.clipped.store(u32::MAX - 1, Relaxed);
        shared.count_sample();
        shared.count_overruns(3);
        shared.count_clipped(4);
        let counts = shared.counts();
        assert_eq!(counts.samples, 1 << 32);
        assert_eq!((counts.overruns, counts.clipped), (2, 2));
        shared.count_sample();
        assert_eq!(shared.counts().samples, (1 << 32) + 1);
    }
}
