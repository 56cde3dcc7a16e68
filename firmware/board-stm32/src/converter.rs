//! The chain of converters behind [`firmware::Converter`].

use ads1299::{CHANNELS, Chain, Error, Reading, SILENCE, Sampler, SelfTest, Settings};
use defmt::{Display2Format, error, info};
use embassy_stm32::{
    Peri,
    exti::{ExtiInput, TriggerEdge},
    gpio::{AnyPin, ExtiPin, Level, Output, Pin, Pull, Speed},
    mode::Blocking,
};
use embassy_time::{Instant, with_deadline};
use firmware::{Conversion, Converter, deadlines};
use pipeline::Sample;

use crate::{
    Bus, FRAME_BYTES,
    delay::Delay,
    drdy::{self, Edge, Falls},
};

/// Converters in the chain.
pub const CHIPS: usize = 8;

const _: () = assert!(model::CHANNELS == CHIPS * CHANNELS);

/// The wires between microcontroller and chain.
pub struct Wires {
    bus: Bus,
    /// Chip 0 is the one at MISO.
    selects: [Output<'static>; CHIPS],
    start: Output<'static>,
    reset: Output<'static>,
    drdy: ExtiInput<'static, Blocking>,
}

type Wired = Chain<Bus, Output<'static>, Delay, CHIPS>;

impl Wires {
    /// The chain at rest: SPI, START and RESET are those of all chips, DRDY that of chip 0, on one of
    /// EXTI's lines 5 to 9; the first select is that of chip 0, the one at MISO.
    pub fn new<Drdy: Pin + ExtiPin>(
        bus: Bus,
        selects: [Peri<'static, AnyPin>; CHIPS],
        [start, reset]: [Peri<'static, AnyPin>; 2],
        drdy: Peri<'static, Drdy>,
        drdy_line: Peri<'static, Drdy::ExtiChannel>,
    ) -> Self {
        Self {
            bus,
            selects: selects.map(|select| Output::new(select, Level::High, Speed::High)),
            start: Output::new(start, Level::Low, Speed::Low),
            reset: Output::new(reset, Level::High, Speed::Low),
            drdy: ExtiInput::new_blocking(drdy, drdy_line, Pull::Up, TriggerEdge::Falling),
        }
    }

    /// The chain, and the input that tells of its samples, asleep.
    fn into_chain(mut self) -> (Wired, ExtiInput<'static, Blocking>) {
        self.drdy.disable_interrupt();
        let chain = Chain {
            spi: self.bus,
            selects: self.selects,
            start: self.start,
            reset: self.reset,
            delay: Delay,
        };
        (chain, self.drdy)
    }
}

/// A chain that converts, or one that could not be brought up. It belongs in a static: what a task holds
/// by value passes over its stack.
pub(crate) struct Adc {
    sampler: Sampler<Bus, Output<'static>, Delay, CHIPS, FRAME_BYTES>,
    drdy: ExtiInput<'static, Blocking>,
    test: &'static mut SelfTest<CHIPS>,
    /// Why the chain did not come up as it should, the last time.
    failure: Option<Error>,
    /// Until when the next edge must come.
    due: Instant,
    silent: bool,
}

impl Adc {
    /// A chain at rest; `test` is memory for the self-test.
    pub(crate) fn new(wires: Wires, test: &'static mut SelfTest<CHIPS>) -> Self {
        let (chain, drdy) = wires.into_chain();
        Self {
            sampler: Sampler::new(chain, Settings::EEG),
            drdy,
            test,
            failure: None,
            due: Instant::MIN,
            silent: false,
        }
    }

    /// Brings the chain up and starts it; what is wrong is told, and flagged in every sample.
    pub(crate) async fn begin(&mut self) {
        self.drdy.enable_interrupt();
        self.failure = self.sampler.begin(|| ()).await.err();
        log(self.failure.as_ref());
        self.due = Instant::now() + SILENCE * deadlines::SAMPLE;
    }

    /// Hands over the counts, and says what was found with them.
    fn hand_over(&self, reading: &Reading<CHIPS>, sample: &mut Sample, edge: &Edge) -> Conversion {
        let counts = self.sampler.counts().as_flattened();
        for (place, count) in sample.counts.iter_mut().zip(counts) {
            *place = *count;
        }
        Conversion {
            drdy_us: edge.us,
            #[expect(clippy::cast_possible_truncation, reason = "ticks wrap")]
            drdy_ticks: edge.us as u32,
            // An edge that nobody waited for leaves a gap as well.
            missed: edge.missed.max(reading.missed),
            status_bad: !reading.is_sound(),
            lead_off: reading.lead_off(),
        }
    }
}

fn log(failure: Option<&Error>) {
    match failure {
        None => info!("{} converters run", CHIPS),
        Some(error) => error!("{}", Display2Format(error)),
    }
}

impl Converter for &mut Adc {
    async fn next(&mut self, sample: &mut Sample) -> Conversion {
        if let Ok(edge) = with_deadline(self.due, drdy::next()).await {
            self.silent = false;
            self.due = Instant::from_micros(edge.us) + SILENCE * deadlines::SAMPLE;
            let reading = self.sampler.read(edge.us).await;
            return self.hand_over(&reading, sample, &edge);
        }
        // Nothing converts: samples that say so, in their rhythm.
        let us = self.due.as_micros();
        self.due += deadlines::SAMPLE;
        let before = core::mem::replace(&mut self.silent, true);
        let reading = self.sampler.silence(if before { 0 } else { SILENCE - 1 });
        self.hand_over(&reading, sample, &Edge { us, missed: 0 })
    }

    fn state(&self) -> Option<link::Converters> {
        let sampler = &self.sampler;
        Some(device::converters(
            self.failure.as_ref(),
            sampler.millihertz(),
            sampler.last(),
            sampler.counters(),
        ))
    }

    /// A chain that did not come up is reset and set up as well, so that it need not be the board.
    async fn self_test(&mut self, alive: impl FnMut()) {
        let falls = Falls::default();
        self.sampler
            .self_test(self.test, &mut &falls, || falls.us.get(), alive)
            .await;
        self.failure = self.test.report().not_restored;
        log(self.failure.as_ref());
        self.due = Instant::now() + SILENCE * deadlines::SAMPLE;
        self.silent = false;
    }

    fn tested(&self) -> Option<link::SelfTest> {
        Some(device::self_test(self.test.report()))
    }
}
