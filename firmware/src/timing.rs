//! Durations of the stages, as histograms in eighths of each stage's deadline.

use core::{
    num::NonZeroU32,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use embassy_time::Duration;
use link::{Stage, StageTiming};

use crate::{deadlines, stack::Stack};

/// A board's free-running 32-bit counter, which measures the execution times of the stages.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Returns the counter in ticks. The counter must not wrap within the longest deadline.
    pub now: fn() -> u32,
    /// Ticks per second.
    pub hz: u32,
}

/// Number of histogram bins up to the deadline; one more bin counts longer durations.
const BINS: usize = 8;

/// Stages that are timed, with their deadlines; the index is the number of the [`Stage`] on the
/// wire.
const STAGES: [(Stage, Duration); 4] = [
    (Stage::Acquire, deadlines::SAMPLE),
    (Stage::Step, deadlines::STEP),
    (Stage::Code, deadlines::STEP),
    (Stage::Send, deadlines::CODE),
];

/// Durations of every stage since boot.
#[derive(Debug)]
pub(crate) struct Timing {
    clock: Clock,
    stages: [StageTime; STAGES.len()],
}

impl Timing {
    pub(crate) const fn new(clock: Clock) -> Self {
        let mut timing = Self { clock, stages: [const { StageTime::new() }; STAGES.len()] };
        let mut index = 0;
        while index < STAGES.len() {
            timing.stages[index].bin_ticks = bin_ticks(STAGES[index].1, clock.hz);
            index += 1;
        }
        timing
    }

    /// Returns the present count of the board's clock, in ticks.
    pub(crate) fn now(&self) -> u32 {
        (self.clock.now)()
    }

    /// Records that a stage that started at `start_ticks` ends now.
    pub(crate) fn record(&self, stage: Stage, start_ticks: u32) {
        let ticks = self.now().wrapping_sub(start_ticks);
        if let Some(time) = self.stages.get(usize::from(u8::from(stage))) {
            time.record(ticks);
        }
    }

    /// Returns the `Timing` message. If `stack` is `None`, its stack sizes are 0.
    pub(crate) fn report(&self, stack: Option<Stack>) -> link::Timing {
        let bytes = |bytes: usize| u32::try_from(bytes).unwrap_or(u32::MAX);
        let stages = STAGES.iter().zip(&self.stages);
        link::Timing {
            stages: stages
                .map(|(&(stage, deadline), time)| StageTiming {
                    stage,
                    deadline_ns: nanoseconds(deadline.as_micros(), 1_000_000),
                    worst_ns: nanoseconds(time.worst_ticks.load(Relaxed).into(), self.clock.hz),
                    histogram: time.histogram.each_ref().map(|count| count.load(Relaxed)),
                })
                .collect(),
            stack_used: stack.map_or(0, |stack| bytes(stack.peak_bytes())),
            stack_size: stack.map_or(0, |stack| bytes(stack.size())),
        }
    }
}

/// Durations of one stage since boot. Only one task writes them.
#[derive(Debug)]
struct StageTime {
    /// Width of a histogram bin, an eighth of the stage's deadline, in ticks.
    bin_ticks: NonZeroU32,
    worst_ticks: AtomicU32,
    histogram: [AtomicU32; BINS + 1],
}

impl StageTime {
    const fn new() -> Self {
        Self {
            bin_ticks: NonZeroU32::MIN,
            worst_ticks: AtomicU32::new(0),
            histogram: [const { AtomicU32::new(0) }; BINS + 1],
        }
    }

    fn record(&self, ticks: u32) {
        if ticks > self.worst_ticks.load(Relaxed) {
            self.worst_ticks.store(ticks, Relaxed);
        }
        let bin = usize::try_from(ticks.saturating_sub(1) / self.bin_ticks).unwrap_or(BINS);
        if let Some(count) = self.histogram.get(bin.min(BINS)) {
            count.fetch_add(1, Relaxed);
        }
    }
}

/// Returns an eighth of a deadline in ticks, rounded down, so that a late stage never counts as in
/// time.
const fn bin_ticks(deadline: Duration, hz: u32) -> NonZeroU32 {
    let ticks = deadline.as_micros() * hz as u64 / 1_000_000;
    assert!(ticks < 1 << 31, "the clock wraps within a deadline");
    #[expect(clippy::cast_possible_truncation, reason = "asserted")]
    let bin = (ticks / BINS as u64) as u32;
    NonZeroU32::new(bin).expect("a tick of the clock is longer than a bin")
}

fn nanoseconds(ticks: u64, hz: u32) -> u32 {
    u32::try_from(ticks * 1_000_000_000 / u64::from(hz)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_is_counted_in_its_bin_and_the_worst_is_kept() {
        const MHZ: Clock = Clock { now: || 10_000, hz: 1_000_000 };
        let timing = Timing::new(MHZ);
        // 7,812 ticks divided by 8 bins are 976 ticks, rounded down. So 976 is the longest duration
        // in the first bin, 7,808 = 8 x 976 the longest in the last bin, and 7,809 counts as late.
        for ticks in [1, 976, 977, 7_808, 7_809, 9_999] {
            timing.record(Stage::Step, 10_000 - ticks);
        }
        let report = timing.report(None);
        assert_eq!(report.stages.len(), STAGES.len());
        let step = &report.stages[1];
        assert_eq!(step.histogram, [2, 1, 0, 0, 0, 0, 0, 1, 2]);
        assert_eq!((step.worst_ns, step.deadline_ns), (9_999_000, 7_812_000));
        assert_eq!(report.stages[0].histogram, [0; 9]);
    }
}
