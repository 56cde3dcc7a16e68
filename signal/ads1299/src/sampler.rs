//! Reader of a chain's samples that also counts their errors.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bring_up::BringUp;
use crate::bus::Bus;
use crate::chain::{COLD_US, Chain, POWER_ON_US, number};
use crate::decoder::{CHANNELS, Decoder, MAX_CHIPS};
use crate::error::Error;
use crate::reading::Reading;
use crate::ready::RateWatch;
use crate::settings::Settings;

/// Number of sample periods without an edge of DRDY after which a chain counts as silent.
pub const SILENCE: u32 = 4;

/// Owns a chain, reads every sample and reports its errors.
///
/// While a chip's part of the frame is invalid, the sampler repeats the chip's previous counts.
/// `BYTES` is [`frame_bytes`](crate::decoder::frame_bytes) for `CHIPS` chips, checked at compile
/// time.
#[derive(Debug)]
pub struct Sampler<Spi, Line, Delay, const CHIPS: usize, const BYTES: usize> {
    pub(crate) chain: Chain<Spi, Line, Delay, CHIPS>,
    pub(crate) settings: Settings,
    pub(crate) decoder: Decoder<CHIPS>,
    pub(crate) frame: [u8; BYTES],
    pub(crate) decoded: [[i32; CHANNELS]; CHIPS],
    counts: [[i32; CHANNELS]; CHIPS],
    watch: RateWatch,
    is_running: bool,
    /// Chips with a wrong ID or register, one bit each: their counts are never used.
    unfit: u8,
    counters: SamplerCounters<CHIPS>,
    last: Option<Reading<CHIPS>>,
}

/// Counters of a sampler since its creation; each wraps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplerCounters<const CHIPS: usize> {
    /// Number of readings in which a chip was bad, per chip. A reading with a wrong rate counts for
    /// chip 0, a reading without a frame for all chips.
    pub errors: [u32; CHIPS],
    /// Number of samples that were not read.
    pub missed: u32,
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize, const BYTES: usize>
    Sampler<Spi, Line, Delay, CHIPS, BYTES>
{
    /// Creates a sampler for a stopped chain with these settings.
    pub const fn new(chain: Chain<Spi, Line, Delay, CHIPS>, settings: Settings) -> Self {
        const { assert!(CHIPS >= 1 && CHIPS <= MAX_CHIPS, "1 to 8 chips") };
        Self {
            chain,
            settings,
            decoder: Decoder::new(),
            frame: [0; BYTES],
            decoded: [[0; CHANNELS]; CHIPS],
            counts: [[0; CHANNELS]; CHIPS],
            watch: RateWatch::new(settings.clock, settings.rate),
            is_running: false,
            unfit: Reading::<CHIPS>::ALL,
            counters: SamplerCounters { errors: [0; CHIPS], missed: 0 },
            last: None,
        }
    }

    /// Brings the chain up and starts it, in the order of the data sheet (figure 67, times of
    /// section 11.1): START low and chips deselected, wait 2^18 tCLK, reset, wait 18 tCLK, SDATAC,
    /// switch the references on and wait 150 ms, write all other registers, read all registers
    /// back, START, RDATAC. It takes 0.33 s for eight chips; `progress` is called at least every 20
    /// ms. If VCAP1 needs more than 175 ms to reach 1.1 V, call [`Self::start_cold`] instead.
    ///
    /// # Errors
    /// The first error. If only some chips have a wrong ID or register, the chain runs, and these
    /// chips are bad in every reading. If all chips have a wrong ID or register, or if the bus or a
    /// pin fails, the chain stays stopped.
    pub async fn start(&mut self, mut progress: impl FnMut()) -> Result<(), Error> {
        let mut bring_up = BringUp::from_power(POWER_ON_US);
        self.finish(&mut bring_up, &mut progress).await
    }

    /// Like [`Self::start`], but waits 1 s for VCAP1, because the supplies may have just come on.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub async fn start_cold(&mut self, mut progress: impl FnMut()) -> Result<(), Error> {
        let mut bring_up = BringUp::from_power(COLD_US);
        self.finish(&mut bring_up, &mut progress).await
    }

    /// Brings up chips that have been reset since power-on, and starts them.
    pub(crate) async fn resume(&mut self, progress: &mut impl FnMut()) -> Result<(), Error> {
        self.finish(&mut BringUp::from_reset(), progress).await
    }

    async fn finish(
        &mut self,
        bring_up: &mut BringUp<CHIPS>,
        progress: &mut impl FnMut(),
    ) -> Result<(), Error> {
        self.is_running = false;
        self.chain.finish(self.settings, bring_up, progress).await?;
        self.run_checked(bring_up).await
    }

    /// Runs the next stage of a bring-up; the last stage starts the chain. Returns the delay before
    /// the next stage in microseconds, or `None` after the last one.
    pub(crate) async fn run_stage(
        &mut self,
        bring_up: &mut BringUp<CHIPS>,
    ) -> Result<Option<u32>, Error> {
        self.is_running = false;
        let wait_us = self.chain.run_stage(self.settings, bring_up).await?;
        if wait_us.is_none() {
            self.run_checked(bring_up).await?;
        }
        Ok(wait_us)
    }

    /// Checks the registers that were read back, and starts the chain unless every chip is unfit.
    async fn run_checked(&mut self, bring_up: &BringUp<CHIPS>) -> Result<(), Error> {
        self.unfit = 0;
        let mut checked = Ok(());
        for (chip, read_back) in bring_up.read_backs.iter().enumerate() {
            let fits = read_back.check(number(chip), &self.settings.image(chip));
            self.unfit |= u8::from(fits.is_err()) << chip;
            checked = checked.and(fits);
        }
        if self.unfit != Reading::<CHIPS>::ALL {
            self.chain.run(self.settings).await?;
            self.is_running = true;
        }
        self.watch = RateWatch::new(self.settings.clock, self.settings.rate);
        checked
    }

    /// Returns whether the chips convert.
    pub const fn is_running(&self) -> bool {
        self.is_running
    }

    /// Returns the settings with which the chain is brought up.
    pub const fn settings(&self) -> Settings {
        self.settings
    }

    /// Returns whether electrodes are excited, to measure their impedance.
    #[inline]
    pub const fn is_excited(&self) -> bool {
        self.settings.excited_channels() != 0
    }

    /// Returns the newest valid counts of each channel, |count| <= 2^23.
    pub const fn counts(&self) -> &[[i32; CHANNELS]; CHIPS] {
        &self.counts
    }

    /// Returns the newest reading; `None` before the first one.
    pub const fn last(&self) -> Option<&Reading<CHIPS>> {
        self.last.as_ref()
    }

    /// Returns the sample rate measured from DRDY's edges, in millihertz; `None` before the first
    /// measurement. It is updated every 64 periods (1/8 s at 512 Hz), and at an early or late edge.
    pub const fn millihertz(&self) -> Option<u32> {
        self.watch.millihertz()
    }

    /// Returns how many readings of each chip were bad and how many samples were missed since this
    /// sampler was created.
    pub const fn counters(&self) -> &SamplerCounters<CHIPS> {
        &self.counters
    }

    /// Reads the sample whose DRDY edge was at `edge_us`, in microseconds; [`Self::counts`] then
    /// returns its counts.
    ///
    /// # Timing
    /// Call it directly after DRDY falls; it must end before DRDY falls again. Clocking takes 108
    /// us for eight chips at 16 MHz, and 3 us more pass until the chips are deselected;
    /// [`Decoder::decode`] follows. No allocation, no panic.
    pub async fn read(&mut self, edge_us: u64) -> Reading<CHIPS> {
        let (missed, rate) = self.watch.edge(edge_us);
        let mut reading = Reading { status: None, bad: Reading::<CHIPS>::ALL, missed, rate };
        let wiring = self.settings.wiring;
        if self.is_running && self.chain.read_frame(&mut self.frame, wiring).await.is_ok() {
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

    /// Records a missing sample. Call it after [`SILENCE`] periods without an edge of DRDY, and
    /// then once per period. `missed` is the number of samples missing before this one and not yet
    /// reported: three ([`SILENCE`] less one) in the first call, then 0.
    pub fn silence(&mut self, missed: u32) -> Reading<CHIPS> {
        self.watch.restart();
        let reading = Reading { status: None, bad: Reading::<CHIPS>::ALL, missed, rate: None };
        self.count(&reading);
        reading
    }

    fn count(&mut self, reading: &Reading<CHIPS>) {
        self.last = Some(*reading);
        let counters = &mut self.counters;
        counters.missed = counters.missed.wrapping_add(reading.missed);
        let of_rate = reading.rate.map_or(0, |error| 1 << (error.chip() & 7));
        let bad = u32::from(reading.bad | of_rate);
        for (chip, errors) in (0..).zip(&mut counters.errors) {
            *errors = errors.wrapping_add(bad >> chip & 1);
        }
    }
}
