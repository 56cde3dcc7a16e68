//! Sampler that brings its chain up again while no chip delivers samples.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bring_up::BringUp;
use crate::bus::{Bus, Drdy, DrdyEdge};
use crate::chain::COLD_US;
use crate::error::Error;
use crate::reading::Reading;
use crate::sampler::{SILENCE, Sampler};
#[cfg(any(test, feature = "impedance"))]
use crate::settings::Settings;

/// Time that a byte takes in [`RetryingSampler::switch_excitation`], in microseconds: its clocks,
/// the wait after it and the start of the transfer (estimated).
#[cfg(any(test, feature = "impedance"))]
const BYTE_US: u64 = 18;

/// Delivers a sample per period in any case: a real sample or, while the chain is silent, a flagged
/// repetition of the last counts. The first samples of a silence are counted as missed instead.
///
/// When no chip has delivered a valid sample for the retry time, the chain is brought up again,
/// because its supplies may have come on late or failed for a while. The stages of the bring-up run
/// between flagged samples, so the samples keep their rate. While at least one chip delivers, there
/// is no attempt: the valid samples matter more than a broken chip, which a self-test can restart.
/// The chain is also brought up again if chips convert at another rate after a silence, because
/// they have then lost their registers.
#[derive(Debug)]
pub struct RetryingSampler<Spi, Line, Delay, const CHIPS: usize, const BYTES: usize> {
    sampler: Sampler<Spi, Line, Delay, CHIPS, BYTES>,
    /// Time in microseconds from the last valid sample, or the end of the last attempt, to the next
    /// attempt.
    retry_us: u64,
    /// Error of the last bring-up; `None` if it succeeded.
    failure: Option<Error>,
    attempt: Option<Attempt<CHIPS>>,
    /// Time of the last valid sample or of the end of the last attempt, in microseconds.
    since_us: u64,
    /// Time in microseconds at which a flagged repetition is due unless an edge comes first.
    due_us: u64,
    /// True if the last sample was a flagged repetition, or if an attempt to bring the chain up has
    /// stopped it.
    is_silent: bool,
    /// True if the chain has been silent since the last attempt; its registers may then be lost.
    registers_doubtful: bool,
}

/// An attempt in progress to bring the chain up again.
#[derive(Debug)]
struct Attempt<const CHIPS: usize> {
    bring_up: BringUp<CHIPS>,
    /// Earliest time at which the next stage may run, in microseconds.
    next_us: u64,
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize, const BYTES: usize>
    RetryingSampler<Spi, Line, Delay, CHIPS, BYTES>
{
    /// Creates a sampler for a stopped chain. After `retry_us` microseconds without a valid sample,
    /// the sampler brings the chain up again.
    pub const fn new(sampler: Sampler<Spi, Line, Delay, CHIPS, BYTES>, retry_us: u64) -> Self {
        Self {
            sampler,
            retry_us,
            failure: None,
            attempt: None,
            since_us: 0,
            due_us: 0,
            is_silent: false,
            registers_doubtful: false,
        }
    }

    /// Brings the chain up for the first time and starts it. `is_cold` is true if the supplies may
    /// have just come on. [`Self::failure`] returns the error, if any, and every sample flags the
    /// chips concerned.
    pub async fn start(&mut self, is_cold: bool, drdy: &mut impl Drdy) {
        let started = if is_cold {
            self.sampler.start_cold(|| ()).await
        } else {
            self.sampler.start(|| ()).await
        };
        self.restarted(started.err(), drdy);
    }

    /// Records that the chain has been brought up and started by other means, such as a self-test;
    /// `failure` is the error of that start.
    pub fn restarted(&mut self, failure: Option<Error>, drdy: &mut impl Drdy) {
        drdy.forget();
        self.failure = failure;
        self.attempt = None;
        self.since_us = drdy.now_us();
        self.due_us = self.since_us + u64::from(SILENCE) * self.period_us();
        self.is_silent = false;
        self.registers_doubtful = false;
    }

    /// Waits for the next sample; [`Sampler::counts`] then returns its counts.
    ///
    /// # Timing
    /// As [`Sampler::read`]. A stage of a bring-up may run first; a stage fits between two samples.
    pub async fn next(&mut self, drdy: &mut impl Drdy) -> (Reading<CHIPS>, DrdyEdge) {
        // If a sample is already due, no stage runs, because a stage would delay the sample.
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
            self.is_silent = false;
            self.due_us = edge.us + u64::from(SILENCE) * self.period_us();
            let reading = self.sampler.read(edge.us).await;
            let is_in_rhythm = reading.rate.is_none() && reading.missed == 0;
            if reading.bad != Reading::<CHIPS>::ALL && (is_in_rhythm || !self.registers_doubtful) {
                self.since_us = edge.us;
            }
            return (reading, edge);
        }
        let (us, missed) = (self.due_us, 0);
        self.due_us += self.period_us();
        let before = core::mem::replace(&mut self.is_silent, true);
        // A chain that was just started is silent for its settling time, about `SILENCE` periods.
        // Twice that time without a valid sample means that the registers may be lost.
        let silence_us = 2 * u64::from(SILENCE) * self.period_us();
        self.registers_doubtful |= self.attempt.is_none() && us > self.since_us + silence_us;
        let reading = self.sampler.silence(if before { 0 } else { SILENCE - 1 });
        (reading, DrdyEdge { us, missed })
    }

    /// Sets [`Settings::excited`] to `channels` if it has another value, unless a sample is due
    /// soon or the chain is being brought up; call it before every [`Self::next`].
    ///
    /// # Timing
    /// As [`Sampler::set_excitation`], which fits between two samples.
    #[cfg(any(test, feature = "impedance"))]
    pub async fn switch_excitation(&mut self, channels: u8, drdy: &mut impl Drdy) {
        if self.sampler.settings().excited == channels || self.attempt.is_some() {
            return;
        }
        let periods = if self.is_silent { 0 } else { SILENCE - 1 };
        let next_us = self.due_us.saturating_sub(u64::from(periods) * self.period_us());
        let settings = Settings { excited: channels, ..self.sampler.settings() };
        let switch_us = BYTE_US * settings.excitation_bytes(CHIPS) as u64;
        if drdy.now_us() + switch_us <= next_us {
            // After a failure of the bus, the next call tries again.
            let _ = self.sampler.set_excitation(channels).await;
        }
    }

    /// Runs the next stage of a bring-up, if one is due.
    async fn attempt(&mut self, drdy: &mut impl Drdy) {
        let now_us = drdy.now_us();
        if self.attempt.is_none() && now_us < self.since_us + self.retry_us {
            return;
        }
        if self.attempt.is_none() && !self.is_silent {
            // The attempt stops the chain, which then counts as silent at once: the first flagged
            // sample is due one period after the last edge, and no sample counts as missed.
            self.due_us -= u64::from(SILENCE - 1) * self.period_us();
            self.is_silent = true;
        }
        let attempt = self
            .attempt
            .get_or_insert(Attempt { bring_up: BringUp::from_power(COLD_US), next_us: now_us });
        if now_us < attempt.next_us {
            return;
        }
        match self.sampler.run_stage(&mut attempt.bring_up).await {
            Ok(Some(wait_us)) => attempt.next_us = drdy.now_us() + u64::from(wait_us),
            ended => {
                self.failure = ended.err();
                self.attempt = None;
                self.registers_doubtful = false;
                self.since_us = drdy.now_us();
                drdy.forget();
            }
        }
    }

    /// Returns the error of the last bring-up; `None` if it succeeded.
    pub const fn failure(&self) -> Option<&Error> {
        self.failure.as_ref()
    }

    /// Returns the sampler, for its newest counts and its counters.
    pub const fn sampler(&self) -> &Sampler<Spi, Line, Delay, CHIPS, BYTES> {
        &self.sampler
    }

    /// Returns the sampler for a self-test; call [`Self::restarted`] after it.
    pub const fn sampler_mut(&mut self) -> &mut Sampler<Spi, Line, Delay, CHIPS, BYTES> {
        &mut self.sampler
    }

    /// Returns the sample period in microseconds, rounded down.
    const fn period_us(&self) -> u64 {
        let settings = self.sampler.settings();
        settings.clock.nanoseconds(settings.rate.divider()) / 1000
    }
}
