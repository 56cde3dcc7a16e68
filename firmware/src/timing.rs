//! How long each stage takes, against its deadline.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_time::Duration;

use crate::deadlines;

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

/// What a stage has taken since boot. It has one writer.
#[derive(Debug)]
pub struct StageTime {
    deadline: Duration,
    /// Ticks of a part of the deadline.
    part: u32,
    worst: AtomicU32,
    histogram: [AtomicU32; PARTS + 1],
}

impl StageTime {
    const fn new(deadline: Duration, clock: Clock) -> Self {
        let ticks = deadline.as_micros() * clock.hz as u64 / 1_000_000;
        assert!(ticks < 1 << 31, "the clock wraps within a deadline");
        #[expect(clippy::cast_possible_truncation, reason = "asserted")]
        let part = (ticks / PARTS as u64) as u32;
        assert!(part > 0, "the clock is slower than a part of the deadline");
        Self {
            deadline,
            part,
            worst: AtomicU32::new(0),
            histogram: [const { AtomicU32::new(0) }; PARTS + 1],
        }
    }

    fn take(&self, ticks: u32) {
        if ticks > self.worst.load(Relaxed) {
            self.worst.store(ticks, Relaxed);
        }
        let part = usize::try_from(ticks / self.part).unwrap_or(PARTS);
        self.histogram[part.min(PARTS)].fetch_add(1, Relaxed);
    }
}

/// All stages of a board.
#[derive(Debug)]
pub struct Timing {
    clock: Clock,
    stages: [StageTime; Stage::ALL.len()],
}

/// What has a deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    /// From a DRDY edge until the sample is handed on.
    Acquire,
    /// The encoder's work on a step.
    Step,
    /// From the DRDY edge of a window's last sample until its code is handed on.
    Code,
    /// From there until the port has taken the code's frame.
    Send,
}

impl Stage {
    const ALL: [Self; 4] = [Self::Acquire, Self::Step, Self::Code, Self::Send];

    const fn deadline(self) -> Duration {
        match self {
            Self::Acquire => deadlines::SAMPLE,
            Self::Step | Self::Code => deadlines::STEP,
            Self::Send => deadlines::CODE,
        }
    }
}

impl Timing {
    pub(crate) const fn new(clock: Clock) -> Self {
        Self {
            clock,
            stages: [
                StageTime::new(Stage::ALL[0].deadline(), clock),
                StageTime::new(Stage::ALL[1].deadline(), clock),
                StageTime::new(Stage::ALL[2].deadline(), clock),
                StageTime::new(Stage::ALL[3].deadline(), clock),
            ],
        }
    }

    /// Ticks of the board's clock, now.
    pub(crate) fn now(&self) -> u32 {
        (self.clock.now)()
    }

    /// A stage that began at `begin` ends now.
    pub(crate) fn end(&self, stage: Stage, begin: u32) {
        self.stages[stage as usize].take(self.now().wrapping_sub(begin));
    }
}
