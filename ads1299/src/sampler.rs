//! A chain in use: who owns it and reads its samples.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::CHANNELS;
use crate::MAX_CHIPS;
use crate::bring_up::BringUp;
use crate::bus::Bus;
use crate::chain::Chain;
use crate::chain::{check, number};
use crate::command::{COLD_US, POWER_ON_US};
use crate::decoder::Decoder;
use crate::error::Error;
use crate::rate_watch::RateWatch;
use crate::reading::Reading;
use crate::settings::Settings;
use crate::streaming::Streaming;

/// Periods without an edge of DRDY after which a chain is taken to be silent.
pub const SILENCE: u32 = 4;

/// A chain in use: owns the wires, reads every sample and says what is wrong with it.
///
/// A chip whose part of a frame means nothing keeps its counts of before. `BYTES` is
/// [`frame_bytes`](crate::frame_bytes) of the chips, checked when it is compiled.
#[derive(Debug)]
pub struct Sampler<Spi, Line, Delay, const CHIPS: usize, const BYTES: usize> {
    pub(crate) chain: Chain<Spi, Line, Delay, CHIPS>,
    pub(crate) settings: Settings<CHIPS>,
    pub(crate) decoder: Decoder<CHIPS>,
    pub(crate) frame: [u8; BYTES],
    pub(crate) decoded: [[i32; CHANNELS]; CHIPS],
    counts: [[i32; CHANNELS]; CHIPS],
    watch: RateWatch,
    runs: bool,
    /// Chips that are not what they should be, one bit each: their counts are never believed.
    unfit: u8,
    counters: SamplerCounters<CHIPS>,
    last: Option<Reading<CHIPS>>,
}

/// What a sampler has counted since it was made; every counter wraps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplerCounters<const CHIPS: usize> {
    /// Readings given.
    pub readings: u32,
    /// Readings in which a chip was bad, per chip. Chip 0 also answers for a wrong rate, and all of
    /// them where there was no frame.
    pub errors: [u32; CHIPS],
    /// Samples that nobody read.
    pub missed: u32,
    /// Readings at a wrong rate.
    pub wrong_rate: u32,
    /// Readings without a frame: DRDY silent, the bus failed, or nothing converts.
    pub without_frame: u32,
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize, const BYTES: usize>
    Sampler<Spi, Line, Delay, CHIPS, BYTES>
{
    /// A chain that does nothing yet, and what it is to do.
    pub const fn new(chain: Chain<Spi, Line, Delay, CHIPS>, settings: Settings<CHIPS>) -> Self {
        const { assert!(CHIPS >= 1 && CHIPS <= MAX_CHIPS, "1 to 8 chips") };
        Self {
            chain,
            settings,
            decoder: Decoder::new(),
            frame: [0; BYTES],
            decoded: [[0; CHANNELS]; CHIPS],
            counts: [[0; CHANNELS]; CHIPS],
            watch: RateWatch::new(settings.clock, settings.rate),
            runs: false,
            unfit: Reading::<CHIPS>::ALL,
            counters: SamplerCounters {
                readings: 0,
                errors: [0; CHIPS],
                missed: 0,
                wrong_rate: 0,
                without_frame: 0,
            },
            last: None,
        }
    }

    /// Brings the chain up and starts it, as [`Chain::power_up`] and
    /// [`Configured::start`](crate::configured::Configured::start) do; `progress` is called at least every 20 ms.
    ///
    /// # Errors
    /// The first thing wrong. If it is a chip, the chain runs nevertheless, and that chip is bad in
    /// every reading, so that the others are not lost. If it is every chip, the bus or a pin, nothing
    /// runs.
    pub async fn begin(&mut self, mut progress: impl FnMut()) -> Result<(), Error> {
        let mut steps = BringUp::from_power(POWER_ON_US);
        self.finish(&mut steps, &mut progress).await
    }

    /// The same for supplies that may have come on just now: it waits 1 s for VCAP1.
    ///
    /// # Errors
    /// Those of [`Self::begin`].
    pub async fn begin_cold(&mut self, mut progress: impl FnMut()) -> Result<(), Error> {
        let mut steps = BringUp::from_power(COLD_US);
        self.finish(&mut steps, &mut progress).await
    }

    /// Sets the chips up, which must have been reset since power-on, and starts them.
    pub(crate) async fn resume(&mut self, progress: &mut impl FnMut()) -> Result<(), Error> {
        self.finish(&mut BringUp::from_reset(), progress).await
    }

    async fn finish(
        &mut self,
        steps: &mut BringUp<CHIPS>,
        progress: &mut impl FnMut(),
    ) -> Result<(), Error> {
        self.runs = false;
        self.chain.finish(&self.settings, steps, progress).await?;
        self.run_checked(steps).await
    }

    /// Takes the next step of a bring-up; nothing runs until the last one, which starts the chain.
    /// Returns how long to wait before the next step, us, or none after the last one.
    pub(crate) async fn step(&mut self, steps: &mut BringUp<CHIPS>) -> Result<Option<u32>, Error> {
        self.runs = false;
        let wait_us = self.chain.step(&self.settings, steps).await?;
        if wait_us.is_none() {
            self.run_checked(steps).await?;
        }
        Ok(wait_us)
    }

    /// Checks the registers of a chain that has been set up, and starts it unless every chip is unfit.
    async fn run_checked(&mut self, steps: &BringUp<CHIPS>) -> Result<(), Error> {
        self.unfit = 0;
        for (chip, back) in steps.backs.iter().enumerate() {
            let fits = back.check(number(chip), &self.settings.image(chip));
            self.unfit |= u8::from(fits.is_err()) << chip;
        }
        if self.unfit != Reading::<CHIPS>::ALL {
            self.chain.run().await?;
            self.runs = true;
        }
        self.watch = RateWatch::new(self.settings.clock, self.settings.rate);
        check(&steps.backs, &self.settings)
    }

    /// Whether the chips convert.
    pub const fn runs(&self) -> bool {
        self.runs
    }

    /// What the chips are to do.
    pub const fn settings(&self) -> &Settings<CHIPS> {
        &self.settings
    }

    /// The newest counts of each channel that could be believed, |count| <= 2^23.
    pub const fn counts(&self) -> &[[i32; CHANNELS]; CHIPS] {
        &self.counts
    }

    /// What was found with the newest sample.
    pub const fn last(&self) -> Option<&Reading<CHIPS>> {
        self.last.as_ref()
    }

    /// The rate of DRDY, mHz: of the last 1/8 s without a gap, or since the last edge that was early or
    /// late; none before that.
    pub const fn millihertz(&self) -> Option<u32> {
        self.watch.millihertz()
    }

    /// What has been counted.
    pub const fn counters(&self) -> &SamplerCounters<CHIPS> {
        &self.counters
    }

    /// Reads the sample whose edge of DRDY came at a time in us; [`Self::counts`] has it then.
    ///
    /// # Timing
    /// That of [`Streaming::read`] and [`Decoder::decode`]; no allocation, no panic.
    pub async fn read(&mut self, edge_us: u64) -> Reading<CHIPS> {
        let (missed, rate) = self.watch.edge(edge_us);
        let mut reading = Reading {
            status: None,
            bad: Reading::<CHIPS>::ALL,
            missed,
            rate,
        };
        let Settings { clock, rate, .. } = self.settings;
        let mut chain = Streaming::new(&mut self.chain, clock, rate);
        if self.runs && chain.read(&mut self.frame).await.is_ok() {
            let status = self.decoder.decode(&self.frame, &mut self.decoded);
            reading.bad = status.bad | status.repeated | self.unfit;
            reading.status = Some(status);
            let places = self.counts.iter_mut().zip(&self.decoded);
            for (chip, (place, counts)) in places.enumerate() {
                if reading.bad >> chip & 1 == 0 {
                    *place = *counts;
                }
            }
        }
        self.count(&reading);
        reading
    }

    /// Instead of a sample that did not come: no edge of DRDY for [`SILENCE`] periods, then each
    /// period; `missed` are those that went by before it was called.
    pub fn silence(&mut self, missed: u32) -> Reading<CHIPS> {
        self.watch.restart();
        let reading = Reading {
            status: None,
            bad: Reading::<CHIPS>::ALL,
            missed,
            rate: None,
        };
        self.count(&reading);
        reading
    }

    fn count(&mut self, reading: &Reading<CHIPS>) {
        self.last = Some(*reading);
        let counters = &mut self.counters;
        counters.readings = counters.readings.wrapping_add(1);
        counters.missed = counters.missed.wrapping_add(reading.missed);
        let wrong_rate = u32::from(reading.rate.is_some());
        counters.wrong_rate = counters.wrong_rate.wrapping_add(wrong_rate);
        let without_frame = u32::from(reading.status.is_none());
        counters.without_frame = counters.without_frame.wrapping_add(without_frame);
        let of_rate = reading.rate.map_or(0, |error| 1 << (error.chip() & 7));
        let bad = u32::from(reading.bad | of_rate);
        for (chip, errors) in (0..).zip(&mut counters.errors) {
            *errors = errors.wrapping_add(bad >> chip & 1);
        }
    }
}
