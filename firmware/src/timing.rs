//! How long each stage takes, against its deadline.

use core::{
    num::NonZeroU32,
    sync::atomic::{AtomicU32, Ordering::Relaxed},
};

use embassy_time::Duration;
use link::{Stage, StageTiming};

use crate::{Stack, deadlines};

/// A counter of a board that runs freely, as fast as the core if it can.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Ticks so far; wraps, later than the longest deadline.
    pub now: fn() -> u32,
    /// Ticks in a second.
    pub hz: u32,
}

/// Parts of a deadline that a histogram tells apart, and one for what was too late.
const PARTS: usize = 8;

/// The stages of a board, in the order of [`Stage`], with their deadlines.
const STAGES: [(Stage, Duration); 4] = [
    (Stage::Acquire, deadlines::SAMPLE),
    (Stage::Step, deadlines::STEP),
    (Stage::Code, deadlines::STEP),
    (Stage::Send, deadlines::CODE),
];

/// What every stage has taken since boot.
#[derive(Debug)]
pub(crate) struct Timing {
    clock: Clock,
    stages: [StageTime; STAGES.len()],
}

impl Timing {
    pub(crate) const fn new(clock: Clock) -> Self {
        let mut timing = Self {
            clock,
            stages: [const { StageTime::new() }; STAGES.len()],
        };
        let mut index = 0;
        while index < STAGES.len() {
            timing.stages[index].part = part(STAGES[index].1, clock.hz);
            index += 1;
        }
        timing
    }

    /// Ticks of the board's clock, now.
    pub(crate) fn now(&self) -> u32 {
        (self.clock.now)()
    }

    /// A stage that began at `begin` ends now.
    pub(crate) fn end(&self, stage: Stage, begin: u32) {
        let ticks = self.now().wrapping_sub(begin);
        if let Some(time) = self.stages.get(usize::from(u8::from(stage))) {
            time.take(ticks);
        }
    }

    /// As it goes over the wire.
    pub(crate) fn report(&self, stack: Option<Stack>) -> link::Timing {
        let bytes = |bytes: usize| u32::try_from(bytes).unwrap_or(u32::MAX);
        let stages = STAGES.iter().zip(&self.stages);
        link::Timing {
            stages: stages
                .map(|(&(stage, deadline), time)| StageTiming {
                    stage,
                    deadline_ns: nanoseconds(deadline.as_micros(), 1_000_000),
                    worst_ns: nanoseconds(time.worst.load(Relaxed).into(), self.clock.hz),
                    histogram: time.histogram.each_ref().map(|count| count.load(Relaxed)),
                })
                .collect(),
            stack_used: stack.map_or(0, |stack| bytes(stack.used())),
            stack_size: stack.map_or(0, |stack| bytes(stack.size())),
        }
    }
}

/// What one stage has taken since boot. It has one writer.
#[derive(Debug)]
struct StageTime {
    /// Ticks of a part of the deadline.
    part: NonZeroU32,
    worst: AtomicU32,
    histogram: [AtomicU32; PARTS + 1],
}

impl StageTime {
    const fn new() -> Self {
        Self {
            part: NonZeroU32::MIN,
            worst: AtomicU32::new(0),
            histogram: [const { AtomicU32::new(0) }; PARTS + 1],
        }
    }

    fn take(&self, ticks: u32) {
        if ticks > self.worst.load(Relaxed) {
            self.worst.store(ticks, Relaxed);
        }
        let part = usize::try_from(ticks.saturating_sub(1) / self.part).unwrap_or(PARTS);
        if let Some(count) = self.histogram.get(part.min(PARTS)) {
            count.fetch_add(1, Relaxed);
        }
    }
}

/// Ticks of a part of a deadline, rounded down: what is late is never called in time.
const fn part(deadline: Duration, hz: u32) -> NonZeroU32 {
    let ticks = deadline.as_micros() * hz as u64 / 1_000_000;
    assert!(ticks < 1 << 31, "the clock wraps within a deadline");
    #[expect(clippy::cast_possible_truncation, reason = "asserted")]
    let part = (ticks / PARTS as u64) as u32;
    NonZeroU32::new(part).expect("the clock is slower than a part of the deadline")
}

fn nanoseconds(ticks: u64, hz: u32) -> u32 {
    u32::try_from(ticks * 1_000_000_000 / u64::from(hz)).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_is_counted_in_its_part_of_the_deadline_and_the_worst_is_kept() {
        const MHZ: Clock = Clock {
            now: || 10_000,
            hz: 1_000_000,
        };
        let timing = Timing::new(MHZ);
        // Parts of 976 ticks: 7812 over 8.
        for ticks in [1, 976, 977, 7_808, 7_809, 9_999] {
            timing.end(Stage::Step, 10_000 - ticks);
        }
        let report = timing.report(None);
        assert_eq!(report.stages.len(), STAGES.len());
        let step = &report.stages[1];
        assert_eq!(step.histogram, [2, 1, 0, 0, 0, 0, 0, 1, 2]);
        assert_eq!((step.worst_ns, step.deadline_ns), (9_999_000, 7_812_000));
        assert_eq!(report.stages[0].histogram, [0; 9]);
    }
}
