//! The whole self-test of a chain.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::digital::Wait;

use crate::CHANNELS;
use crate::bus::Bus;
use crate::chain::number;
use crate::error::Error;
use crate::gain::Gain;
use crate::image::ReadBack;
use crate::input::Input;
use crate::limits::SelfTestFault;
use crate::ready::ReadyMeter;
use crate::register::Register;
use crate::sampler::Sampler;
use crate::self_test_report::{ReadyReport, SelfTestReport};
use crate::settings::{Channel, Settings};
use crate::shorted_test::ShortedTest;
use crate::square_wave_test::SquareWaveTest;
use crate::streaming::Streaming;
use crate::test_signal::TestSignal;

/// Periods of the test signal that are judged.
const PERIODS: u32 = 2;

/// Samples before the first that counts, and for the transition that may be under way.
const LEAD: u32 = 16;

/// Samples with shorted inputs; as many as the data sheet takes (8.1).
const SHORTED: u32 = 1000;

/// The memory of a self-test, 8 KB for 64 channels: it belongs in a static.
#[derive(Clone, Debug)]
pub struct SelfTest<const CHIPS: usize> {
    judges: [[Judge; CHANNELS]; CHIPS],
    report: SelfTestReport<CHIPS>,
}

/// What judges a channel at the moment; both in one memory.
#[derive(Clone, Debug)]
enum Judge {
    SquareWave(SquareWaveTest),
    Shorted(ShortedTest),
}

impl Judge {
    const fn new(input: Input, gain: Gain) -> Self {
        match input {
            Input::TestSignal => Self::SquareWave(SquareWaveTest::new(gain, TestSignal::SELF_TEST)),
            _ => Self::Shorted(ShortedTest::new(gain)),
        }
    }

    fn push(&mut self, count: i32) {
        match self {
            Self::SquareWave(test) => test.push(count),
            Self::Shorted(test) => test.push(count),
        }
    }
}

impl<const CHIPS: usize> Default for SelfTest<CHIPS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const CHIPS: usize> SelfTest<CHIPS> {
    /// Before anything was measured.
    pub const fn new() -> Self {
        Self {
            judges: [const { [const { Judge::new(Input::Shorted, Gain::X24) }; CHANNELS] }; CHIPS],
            report: SelfTestReport::EMPTY,
        }
    }

    /// What the last test has found.
    pub const fn report(&self) -> &SelfTestReport<CHIPS> {
        &self.report
    }

    /// Takes down what the registers of all chips were like.
    fn note(&mut self, backs: &[ReadBack; CHIPS], settings: &Settings<CHIPS>) {
        for (chip, (report, back)) in self.report.chips.iter_mut().zip(backs).enumerate() {
            let fault = back.check(number(chip), &settings.image(chip)).err();
            report.id = back.read.0[Register::ID.index()];
            report.fault = report.fault.or(fault);
            let differing = u8::try_from(back.differing.count_ones()).unwrap_or(u8::MAX);
            report.differing = report.differing.max(differing);
        }
    }

    /// Takes down what the channels are like at an input.
    fn judge(&mut self, settings: &Settings<CHIPS>) {
        let channels = settings.chips.iter().flat_map(|chip| &chip.channels);
        let reports = self.report.channels.as_flattened_mut().iter_mut();
        let judges = self.judges.as_flattened().iter();
        for ((report, judge), Channel { gain, .. }) in reports.zip(judges).zip(channels) {
            let checked: Result<(), SelfTestFault> = match judge {
                Judge::SquareWave(test) => {
                    let result = test.result();
                    report.gain_error = result.gain_error;
                    report.offset_uv = result.offset_uv;
                    report.noise_uv = result.noise_uv;
                    result.check(*gain, settings.rate)
                }
                Judge::Shorted(test) => {
                    let result = test.result();
                    report.shorted_noise_uv = result.noise_uv;
                    result.check(*gain, settings.rate)
                }
            };
            report.fault = report.fault.or(checked.err());
        }
    }
}

/// What a test needs beside the chain.
struct Beside<'a, Ready, Now, Progress> {
    drdy: &'a mut Ready,
    now_us: Now,
    progress: Progress,
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize, const BYTES: usize>
    Sampler<Spi, Line, Delay, CHIPS, BYTES>
{
    /// Tests every chip and channel, and starts the chain again with the settings that it had; 4.5 s
    /// at 512 Hz. [`SelfTest::report`] says what was found.
    ///
    /// In this order: reset, IDs, registers written and read back; two periods of the chips' own
    /// square wave on all channels with the rate of DRDY; shorted inputs; the settings of before,
    /// read back. A chip that is broken is named, and the others are tested as far as their frames get
    /// past it; without DRDY the test stops. `drdy` gives the edges, `now_us` their times; `progress`
    /// is called for every sample and at least every 20 ms in between, or after the time that
    /// [`Streaming::ready`] waits.
    pub async fn self_test(
        &mut self,
        test: &mut SelfTest<CHIPS>,
        drdy: &mut impl Wait,
        now_us: impl FnMut() -> u64,
        progress: impl FnMut(),
    ) {
        test.report = SelfTestReport::EMPTY;
        let mut beside = Beside {
            drdy,
            now_us,
            progress,
        };
        test.report.stopped = self.examine(test, &mut beside).await.err();
        test.report.not_restored = self.resume(&mut beside.progress).await.err();
    }

    async fn examine(
        &mut self,
        test: &mut SelfTest<CHIPS>,
        beside: &mut Beside<'_, impl Wait, impl FnMut() -> u64, impl FnMut()>,
    ) -> Result<(), Error> {
        let Settings { clock, rate, .. } = self.settings;
        self.chain.reset(&mut beside.progress).await?;
        let mut meter = ReadyMeter::new(0, clock, rate);
        let half = TestSignal::SELF_TEST.frequency.half_period();
        let period = 2 * half.unwrap_or(0) / rate.divider();
        let streamed = self
            .stream(
                test,
                beside,
                Input::TestSignal,
                PERIODS * period + LEAD,
                |now_us| {
                    meter.edge(now_us);
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
        self.stream(test, beside, Input::Shorted, SHORTED, |_| ())
            .await
    }

    /// Sets all channels to one input and judges so many samples.
    async fn stream(
        &mut self,
        test: &mut SelfTest<CHIPS>,
        beside: &mut Beside<'_, impl Wait, impl FnMut() -> u64, impl FnMut()>,
        input: Input,
        samples: u32,
        mut edge: impl FnMut(u64),
    ) -> Result<(), Error> {
        let settings = self.settings.with_input(input);
        let backs = self.chain.set_up(&settings, &mut beside.progress).await?;
        test.note(&backs, &settings);
        for (judges, chip) in test.judges.iter_mut().zip(&settings.chips) {
            for (judge, channel) in judges.iter_mut().zip(&chip.channels) {
                *judge = Judge::new(input, channel.gain);
            }
        }
        self.chain.run().await?;
        let mut chain = Streaming::new(&mut self.chain, settings.clock, settings.rate);
        for _ in 0..samples {
            (beside.progress)();
            chain.ready(beside.drdy).await?;
            edge((beside.now_us)());
            chain.read(&mut self.frame).await?;
            let status = self.decoder.decode(&self.frame, &mut self.decoded);
            let bad = status.bad | status.repeated;
            let chips = test.report.chips.iter_mut().zip(&mut test.judges);
            for (chip, ((report, judges), counts)) in chips.zip(&self.decoded).enumerate() {
                if bad >> chip & 1 != 0 {
                    report.bad_frames = report.bad_frames.wrapping_add(1);
                    continue;
                }
                for (judge, count) in judges.iter_mut().zip(counts) {
                    judge.push(*count);
                }
            }
        }
        self.chain.halt().await?;
        test.judge(&settings);
        Ok(())
    }
}
