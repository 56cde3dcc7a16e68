//! The chain of converters behind [`firmware::Converter`].

use ads1299::{
    CHANNELS, Chain, DrdyEdge, Error, Reading, RetryingSampler, Sampler, SelfTest, Settings,
};
use defmt::{Display2Format, error, info};
use embassy_stm32::{
    Peri,
    exti::{ExtiInput, TriggerEdge},
    gpio::{AnyPin, ExtiPin, Level, Output, Pin, Pull, Speed},
    mode::Blocking,
};
use firmware::{Conversion, Converter, deadlines};
use pipeline::Sample;

use crate::{
    Bus, FRAME_BYTES,
    delay::Delay,
    drdy::{Edges, Falls},
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

/// A chain that converts, or one that could not be brought up and is tried again. It belongs in a static:
/// what a task holds by value passes over its stack.
pub(crate) struct Adc {
    chain: RetryingSampler<Bus, Output<'static>, Delay, CHIPS, FRAME_BYTES>,
    drdy: ExtiInput<'static, Blocking>,
    test: &'static mut SelfTest<CHIPS>,
    /// The error that was logged last; none after a success.
    logged: Option<Error>,
}

impl Adc {
    /// A chain at rest; `test` is memory for the self-test.
    pub(crate) fn new(wires: Wires, test: &'static mut SelfTest<CHIPS>) -> Self {
        let (chain, drdy) = wires.into_chain();
        let sampler = Sampler::new(chain, Settings::EEG);
        Self {
            chain: RetryingSampler::new(sampler, deadlines::CONVERTERS_RETRY.as_micros()),
            drdy,
            test,
            logged: None,
        }
    }

    /// Brings the chain up and starts it; `is_cold` after a start by its supply. What is wrong is logged,
    /// and flagged in every sample.
    pub(crate) async fn begin(&mut self, is_cold: bool) {
        self.drdy.enable_interrupt();
        self.chain.start(is_cold, &mut Edges).await;
        self.log();
    }

    /// Logs how the last attempt ended.
    fn log(&mut self) {
        self.logged = self.chain.failure().copied();
        match self.logged {
            None => info!("{} converters run", CHIPS),
            Some(error) => error!("{}", Display2Format(&error)),
        }
    }

    /// Hands over the counts, with what was found with them.
    fn hand_over(
        &self,
        reading: &Reading<CHIPS>,
        sample: &mut Sample,
        edge: DrdyEdge,
    ) -> Conversion {
        let counts = self.chain.sampler().counts().as_flattened();
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

impl Converter for &mut Adc {
    async fn next(&mut self, sample: &mut Sample) -> Conversion {
        let (reading, edge) = self.chain.next(&mut Edges).await;
        if self.chain.failure() != self.logged.as_ref() {
            self.log();
        }
        self.hand_over(&reading, sample, edge)
    }

    fn state(&self) -> Option<link::Converters> {
        let sampler = self.chain.sampler();
        Some(device::converters_message(
            self.chain.failure(),
            sampler.millihertz(),
            sampler.last(),
            sampler.counters(),
        ))
    }

    /// Also resets and sets up a chain that did not come up, at once.
    async fn self_test(&mut self, alive: impl FnMut()) {
        let falls = Falls::default();
        self.chain
            .sampler_mut()
            .self_test(self.test, &mut &falls, || falls.us.get(), alive)
            .await;
        let failure = self.test.report().not_restored;
        self.chain.restarted(failure, &mut Edges);
        self.log();
    }

    fn tested(&self) -> Option<link::SelfTest> {
        Some(device::self_test_message(self.test.report()))
    }
}
