//! Self-test of a chain of ADS1299 chips: registers, gain, offset, noise and sample rate.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bus::{Bus, Drdy};
use crate::chain::number;
use crate::channel_tests::{ShortedTest, SquareWaveTest};
use crate::decoder::CHANNELS;
use crate::error::Error;
use crate::image::ReadBack;
use crate::limits::SelfTestFault;
use crate::ready::ReadyMeter;
use crate::register::Register;
use crate::sampler::Sampler;
use crate::self_test_report::{ReadyReport, SelfTestReport};
use crate::settings::{Gain, Input, Settings, TEST_HALF_PERIOD};

/// Number of periods of the test signal in which gain, offset and noise are measured.
const PERIODS: u32 = 2;

/// Number of samples in addition to the measured periods, because the filter must settle and a
/// transition may be in progress at the start.
const LEAD: u32 = 16;

/// Number of samples measured with shorted inputs, as in the data sheet (section 8.1).
const SHORTED: u32 = 1000;

/// State and report of a self-test. The size is 8 KB for 64 channels, so place it in a static.
#[derive(Clone, Debug)]
pub struct SelfTest<const CHIPS: usize> {
    measurements: [[Measurement; CHANNELS]; CHIPS],
    report: SelfTestReport<CHIPS>,
}

/// Measurement of one channel. The square wave is measured before the shorted input, so the two
/// tests share memory.
#[derive(Clone, Debug)]
enum Measurement {
    SquareWave(SquareWaveTest),
    Shorted(ShortedTest),
}

impl Measurement {
    const fn new(input: Input, gain: Gain) -> Self {
        match input {
            Input::TestSignal => Self::SquareWave(SquareWaveTest::new(gain)),
            _ => Self::Shorted(ShortedTest::new(gain)),
        }
    }

    fn add_sample(&mut self, count: i32) {
        match self {
            Self::SquareWave(test) => test.add_sample(count),
            Self::Shorted(test) => test.add_sample(count),
        }
    }
}

impl<const CHIPS: usize> Default for SelfTest<CHIPS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const CHIPS: usize> SelfTest<CHIPS> {
    /// Creates a self-test with an empty report.
    pub const fn new() -> Self {
        Self {
            measurements: [const { [const { Measurement::new(Input::Shorted, Gain::X24) }; CHANNELS] };
                CHIPS],
            report: SelfTestReport::EMPTY,
        }
    }

    /// Returns the report of the last self-test.
    pub const fn report(&self) -> &SelfTestReport<CHIPS> {
        &self.report
    }

    /// Compares each chip's registers as read back with the values for `settings`, and notes the
    /// first difference in the report.
    fn record_registers(&mut self, read_backs: &[ReadBack; CHIPS], settings: Settings) {
        for (chip, (report, back)) in self.report.chips.iter_mut().zip(read_backs).enumerate() {
            let fault = back.check(number(chip), &settings.image(chip)).err();
            report.id = back.read.0[Register::ID.index()];
            report.fault = report.fault.or(fault);
            let differing = u8::try_from(back.differing.count_ones()).unwrap_or(u8::MAX);
            report.differing = report.differing.max(differing);
        }
    }

    /// Writes the results of all channels, for the input measured last, into the report.
    fn record_channels(&mut self, settings: Settings) {
        let Settings { gain, rate, .. } = settings;
        let reports = self.report.channels.as_flattened_mut().iter_mut();
        for (report, measurement) in reports.zip(self.measurements.as_flattened()) {
            let checked: Result<(), SelfTestFault> = match measurement {
                Measurement::SquareWave(test) => {
                    let result = test.result();
                    report.gain_error = result.gain_error;
                    report.offset_uv = result.offset_uv;
                    report.noise_uv = result.noise_uv;
                    result.check(gain, rate)
                }
                Measurement::Shorted(test) => {
                    let result = test.result();
                    report.shorted_noise_uv = result.noise_uv;
                    result.check(gain, rate)
                }
            };
            report.fault = report.fault.or(checked.err());
        }
    }
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize, const BYTES: usize>
    Sampler<Spi, Line, Delay, CHIPS, BYTES>
{
    /// Tests every chip and channel, and restarts the chain with its previous settings. The test
    /// lasts 4.5 s at 512 Hz. [`SelfTest::report`] returns the result.
    ///
    /// The stages are:
    ///
    /// 1. reset the chips, check their IDs, write the registers and read them back;
    /// 2. measure two periods of the internal square wave on all channels, and the rate of DRDY;
    /// 3. measure all channels with shorted inputs;
    /// 4. write the previous settings and read them back.
    ///
    /// The report names a broken chip, and the other chips are tested unless the broken chip blocks
    /// their frames. Without DRDY the test stops.
    ///
    /// `progress` is called for every sample and at least every 20 ms in between, except while the
    /// test waits for the first edge of DRDY.
    pub async fn self_test(
        &mut self,
        test: &mut SelfTest<CHIPS>,
        drdy: &mut impl Drdy,
        mut progress: impl FnMut(),
    ) {
        test.report = SelfTestReport::EMPTY;
        test.report.stopped = self.examine(test, drdy, &mut progress).await.err();
        test.report.not_restored = self.resume(&mut progress).await.err();
    }

    async fn examine(
        &mut self,
        test: &mut SelfTest<CHIPS>,
        drdy: &mut impl Drdy,
        progress: &mut impl FnMut(),
    ) -> Result<(), Error> {
        let Settings { clock, rate, .. } = self.settings;
        self.chain.reset(self.settings, progress).await?;
        let mut meter = ReadyMeter::new(0, clock, rate);
        let period = 2 * TEST_HALF_PERIOD / rate.divider();
        let streamed = self
            .stream(
                test,
                (&mut *drdy, &mut *progress),
                (Input::TestSignal, PERIODS * period + LEAD),
                |edge_us| {
                    meter.edge(edge_us);
                },
            )
            .await;
        let checked = meter.check();
        test.report.ready = ReadyReport {
            expected: rate.millihertz(clock),
            measured: meter.millihertz().unwrap_or(0),
            early: meter.early(),
            missed: meter.missed(),
            fault: checked.err(),
        };
        streamed?;
        self.stream(test, (drdy, progress), (Input::Shorted, SHORTED), |_| ()).await
    }

    /// Sets all channels to `input` and measures `samples` samples of each. Calls `edge` with the
    /// time of each edge of DRDY, in microseconds.
    async fn stream(
        &mut self,
        test: &mut SelfTest<CHIPS>,
        (drdy, progress): (&mut impl Drdy, &mut impl FnMut()),
        (input, samples): (Input, u32),
        mut edge: impl FnMut(u64),
    ) -> Result<(), Error> {
        let settings = Settings { input, ..self.settings };
        let read_backs = self.chain.set_up(settings, progress).await?;
        test.record_registers(&read_backs, settings);
        for measurement in test.measurements.as_flattened_mut() {
            *measurement = Measurement::new(input, settings.gain);
        }
        self.chain.run(settings).await?;
        // The wait covers the first sample too, which comes only after the filter has settled.
        let cycles = settings.rate.settling() + 4 * settings.rate.divider();
        let waited_us = settings.clock.microseconds(cycles);
        for _ in 0..samples {
            progress();
            // A frame must be read directly after its edge of DRDY, so an edge that came during the
            // calculations on the previous frame is discarded.
            drdy.forget();
            let end_us = drdy.now_us() + u64::from(waited_us);
            // The error names chip 0, whose DRDY is wired.
            let found = drdy.next_until(end_us).await;
            edge(found.ok_or(Error::NeverReady { chip: 0, waited_us })?.us);
            self.chain.read_frame(&mut self.frame, settings.wiring).await?;
            let status = self.decoder.decode(&self.frame, &mut self.decoded);
            let bad = status.bad | status.repeated;
            let chips = test.report.chips.iter_mut().zip(&mut test.measurements);
            for (chip, ((report, measurements), counts)) in chips.zip(&self.decoded).enumerate() {
                if bad >> chip & 1 != 0 {
                    report.bad_frames = report.bad_frames.wrapping_add(1);
                    continue;
                }
                for (measurement, count) in measurements.iter_mut().zip(counts) {
                    measurement.add_sample(*count);
                }
            }
        }
        self.chain.halt(settings).await?;
        test.record_channels(settings);
        Ok(())
    }
}
