//! A chain that is brought up again when none of its chips delivers.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bring_up::BringUp;
use crate::bus::Bus;
use crate::command::COLD_US;
use crate::drdy::{Drdy, DrdyEdge};
use crate::error::Error;
use crate::reading::Reading;
use crate::sampler::{SILENCE, Sampler};

/// Samples in their rhythm, whatever the chain does: real ones, or flagged ones that repeat the last
/// counts while it is silent.
///
/// A chain of which no chip has delivered a sample for a while is brought up again: its supplies may
/// have come on late, or been away. The steps of that are taken between flagged samples, so that nothing
/// else waits for it. While a single chip delivers, nothing is tried: the samples of the sound chips
/// are worth more than another attempt at a broken one; a self-test makes it. Chips that come back after
/// a silence with another rate have lost their registers, and deliver nothing.
#[derive(Debug)]
pub struct RetryingSampler<Spi, Line, Delay, const CHIPS: usize, const BYTES: usize> {
    sampler: Sampler<Spi, Line, Delay, CHIPS, BYTES>,
    /// From the last sample or attempt to the next attempt, us.
    retry_us: u64,
    /// Why the chain did not come up as it should, at the last attempt.
    failure: Option<Error>,
    attempt: Option<Attempt<CHIPS>>,
    /// The last sample of a chip, or the end of the last attempt, us.
    since_us: u64,
    /// Until when the next edge must come, us.
    due_us: u64,
    /// The last sample was not one of the chips'.
    silent: bool,
    /// The chain was silent since the last attempt: its registers may be lost.
    is_doubted: bool,
}

/// An attempt that is under way.
#[derive(Debug)]
struct Attempt<const CHIPS: usize> {
    steps: BringUp<CHIPS>,
    /// When the next step may be taken, us.
    next_us: u64,
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize, const BYTES: usize>
    RetryingSampler<Spi, Line, Delay, CHIPS, BYTES>
{
    /// A chain that does nothing yet, and how long none of its chips may deliver, us.
    pub const fn new(sampler: Sampler<Spi, Line, Delay, CHIPS, BYTES>, retry_us: u64) -> Self {
        Self {
            sampler,
            retry_us,
            failure: None,
            attempt: None,
            since_us: 0,
            due_us: 0,
            silent: false,
            is_doubted: false,
        }
    }

    /// Brings the chain up for the first time and starts it; `is_cold` if its supplies may have come on
    /// just now. What is wrong is in [`Self::failure`] and flagged in every sample.
    pub async fn begin(&mut self, is_cold: bool, drdy: &mut impl Drdy) {
        let begun = if is_cold {
            self.sampler.begin_cold(|| ()).await
        } else {
            self.sampler.begin(|| ()).await
        };
        self.begun(begun.err(), drdy);
    }

    /// The chain has just been set up and started by other means, such as a self-test.
    pub fn begun(&mut self, failure: Option<Error>, drdy: &mut impl Drdy) {
        drdy.forget();
        self.failure = failure;
        self.attempt = None;
        self.since_us = drdy.now_us();
        self.due_us = self.since_us + u64::from(SILENCE) * self.period_us();
        self.silent = false;
        self.is_doubted = false;
    }

    /// Waits for the next sample; [`Sampler::counts`] has it then.
    ///
    /// # Timing
    /// That of [`Sampler::read`]. A step of an attempt fits into the period before a sample.
    pub async fn next(&mut self, drdy: &mut impl Drdy) -> (Reading<CHIPS>, DrdyEdge) {
        // What is late already does not wait for a step.
        if drdy.now_us() < self.due_us {
            self.attempt(drdy).await;
        }
        let edge = if self.attempt.is_some() {
            drdy.wait_until(self.due_us).await;
            None
        } else {
            drdy.next_until(self.due_us).await
        };
        if let Some(edge) = edge {
            self.silent = false;
            self.due_us = edge.us + u64::from(SILENCE) * self.period_us();
            let reading = self.sampler.read(edge.us).await;
            let is_in_rhythm = reading.rate.is_none() && reading.missed == 0;
            if reading.bad != Reading::<CHIPS>::ALL && (is_in_rhythm || !self.is_doubted) {
                self.since_us = edge.us;
            }
            return (reading, edge);
        }
        let (us, missed) = (self.due_us, 0);
        self.due_us += self.period_us();
        let before = core::mem::replace(&mut self.silent, true);
        // A chain that has just been started settles for half of this.
        let silence_us = 2 * u64::from(SILENCE) * self.period_us();
        self.is_doubted |= self.attempt.is_none() && us > self.since_us + silence_us;
        let reading = self.sampler.silence(if before { 0 } else { SILENCE - 1 });
        (reading, DrdyEdge { us, missed })
    }

    /// Takes a step of an attempt, if one is due.
    async fn attempt(&mut self, drdy: &mut impl Drdy) {
        let now_us = drdy.now_us();
        if self.attempt.is_none() && now_us < self.since_us + self.retry_us {
            return;
        }
        if self.attempt.is_none() && !self.silent {
            // The chain is stopped: samples that do not come are none that were missed.
            self.due_us -= u64::from(SILENCE - 1) * self.period_us();
            self.silent = true;
        }
        let attempt = self.attempt.get_or_insert(Attempt {
            steps: BringUp::from_power(COLD_US),
            next_us: now_us,
        });
        if now_us < attempt.next_us {
            return;
        }
        match self.sampler.step(&mut attempt.steps).await {
            Ok(Some(wait_us)) => attempt.next_us = drdy.now_us() + u64::from(wait_us),
            ended => {
                self.failure = ended.err();
                self.attempt = None;
                self.is_doubted = false;
                self.since_us = drdy.now_us();
                drdy.forget();
            }
        }
    }

    /// Why the chain did not come up as it should, at the last attempt.
    pub const fn failure(&self) -> Option<&Error> {
        self.failure.as_ref()
    }

    /// The chain.
    pub const fn sampler(&self) -> &Sampler<Spi, Line, Delay, CHIPS, BYTES> {
        &self.sampler
    }

    /// The chain, for a self-test; [`Self::begun`] follows it.
    pub const fn sampler_mut(&mut self) -> &mut Sampler<Spi, Line, Delay, CHIPS, BYTES> {
        &mut self.sampler
    }

    /// From one sample to the next, us, rounded down.
    const fn period_us(&self) -> u64 {
        let settings = self.sampler.settings();
        settings.clock.nanoseconds(settings.rate.divider()) / 1000
    }
}
