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
