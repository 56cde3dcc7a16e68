//! State that tasks of different priorities share outside the queues: orders, reports and counts.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering::Relaxed};

use device::{Counts, Order};
use embassy_sync::signal::Signal;
use link::{Converters, ExclusionPolicy, SelfTest};
use pipeline::{FeatureFilters, PackedEncoder, Rate};

use crate::{
    inputs::Inputs,
    progress::Progress,
    queues::RawMutex,
    shared_slot::SharedSlot,
    timing::{Clock, Timing},
};

const DEFAULT_RATE: Rate = PackedEncoder::DEFAULT_RATE;

/// Filters of the features, as set by the host, for the encoder. They are not a field of
/// [`Shared`], whose initial values take flash; this static starts as zeros and takes none.
pub(crate) static FILTERS: Signal<RawMutex, FeatureFilters> = Signal::new();

/// Shared state of the tasks; a board declares one static of this type. The acquisition alone
/// writes the counts that [`counts`](Self::counts) returns, except `clipped`, which the encoder
/// writes.
pub struct Shared {
    /// Order to the acquisition; a newer order replaces one that the acquisition has not read yet.
    pub(crate) orders: Signal<RawMutex, Order>,
    /// Number of samples read during runs since boot: the lower 32 bits, then the upper 32 bits.
    samples: [AtomicU32; 2],
    overruns: AtomicU32,
    adc_status_bad: AtomicU32,
    /// Number of clipped electrode values since boot, from the encoder.
    pub(crate) clipped: AtomicU32,
    /// Number of outputs that were lost to a full queue. The encoder counts them; the conversation
    /// reads the number and resets it to 0.
    pub(crate) outputs_lost: AtomicU32,
    /// Index of the packed code's rate: the default rate, or the rate that the host has set.
    rate: AtomicU8,
    /// Whether the excitation current, with which the impedance of the electrodes is measured, must
    /// be on.
    excitation: AtomicBool,
    /// The host's decision about the exclusion of electrodes, for the encoder.
    pub(crate) exclusion: Signal<RawMutex, ExclusionPolicy>,
    /// Memory for a packed model that the host uploads, if the board has such memory.
    pub slot: SharedSlot,
    /// Captured events at the board's inputs, for the encoder.
    pub inputs: Inputs,
    /// Latest status of the converters, set by the acquisition.
    pub(crate) converter_status: Signal<RawMutex, Converters>,
    /// Result of the latest self-test, set by the acquisition.
    pub(crate) self_test_result: Signal<RawMutex, SelfTest>,
    pub(crate) timing: Timing,
    /// Progress of the tasks, for [`keep_alive`](crate::keep_alive).
    pub progress: Progress,
}

impl Shared {
    /// Creates the state at boot: no order, all counts zero. `clock` times the stages.
    pub const fn new(clock: Clock) -> Self {
        Self {
            orders: Signal::new(),
            samples: [const { AtomicU32::new(0) }; 2],
            overruns: AtomicU32::new(0),
            adc_status_bad: AtomicU32::new(0),
            clipped: AtomicU32::new(0),
            outputs_lost: AtomicU32::new(0),
            rate: AtomicU8::new(DEFAULT_RATE.index()),
            excitation: AtomicBool::new(false),
            exclusion: Signal::new(),
            slot: SharedSlot::new(),
            inputs: Inputs::new(),
            converter_status: Signal::new(),
            self_test_result: Signal::new(),
            timing: Timing::new(clock),
            progress: Progress::new(),
        }
    }

    /// Sends `order` to the acquisition. It replaces an order that has not been read yet.
    pub fn send_order(&self, order: Order) {
        self.orders.signal(order);
    }

    /// Sets the rate of the packed code, which determines its quantiser's step.
    pub(crate) fn set_rate(&self, rate: Rate) {
        self.rate.store(rate.index(), Relaxed);
    }

    pub(crate) fn rate(&self) -> Rate {
        Rate::new(self.rate.load(Relaxed)).unwrap_or(DEFAULT_RATE)
    }

    /// Switches the current with which the impedance of the electrodes is measured on or off.
    pub(crate) fn set_excitation(&self, on: bool) {
        self.excitation.store(on, Relaxed);
    }

    #[cfg(any(test, feature = "impedance"))]
    pub(crate) fn is_excited(&self) -> bool {
        self.excitation.load(Relaxed)
    }

    /// Returns the numbers of samples, overruns, bad status words and clipped values since boot.
    pub fn counts(&self) -> Counts {
        // The acquisition can preempt a reader between the loads. If the lower half overflows
        // meanwhile, the two loads of the upper half differ, and the loop reads again.
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
}

#[cfg(test)]
mod tests {
    use device::Run;
    use link::Streams;

    use super::*;

    fn shared() -> Shared {
        Shared::new(Clock { now: || 0, hz: 1_000_000 })
    }

    #[test]
    fn a_newer_order_replaces_one_that_was_not_read_yet() {
        let shared = shared();
        let run = |number| Order::Start(Run { number, streams: Streams::CODES, ..Run::NONE });
        shared.send_order(run(1));
        shared.send_order(Order::Stop);
        assert_eq!(shared.orders.try_take(), Some(Order::Stop));
        assert_eq!(shared.orders.try_take(), None);
        for order in [Order::Stop, run(2), run(3)] {
            shared.send_order(order);
        }
        assert_eq!(shared.orders.try_take(), Some(run(3)));
        assert_eq!(shared.orders.try_take(), None);
    }

    #[test]
    fn samples_are_counted_in_64_bits_and_the_other_counts_wrap() {
        let shared = shared();
        shared.samples[0].store(u32::MAX, Relaxed);
        shared.overruns.store(u32::MAX, Relaxed);
        shared.count_sample();
        shared.count_overruns(3);
        let counts = shared.counts();
        assert_eq!(counts.samples, 1 << 32);
        assert_eq!(counts.overruns, 2);
        shared.count_sample();
        assert_eq!(shared.counts().samples, (1 << 32) + 1);
    }
}
