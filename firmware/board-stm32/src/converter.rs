//! Chain of ADS1299 converters as a [`firmware::Converter`].

use core::{array, convert::Infallible};

use ads1299::{Chain, Control, Drdy, DrdyEdge, Error, Reading, RetryingSampler, Sampler, SelfTest};
use defmt::{Display2Format, error, info};
use device::{CHIPS, CONVERTER_SETTINGS};
use embassy_stm32::{
    Peri,
    exti::{ExtiInput, TriggerEdge},
    gpio::{AnyPin, ExtiPin, Level, Output, Pin, Pull, Speed},
    mode::Blocking,
};
use embedded_hal::digital::{ErrorType, OutputPin};
use firmware::{Conversion, Converter, deadlines};
use pipeline::Sample;

use crate::bus::{Bus, Delay, FRAME_BYTES};
use crate::drdy::DrdyEdges;
use crate::trigger;

/// Pins and SPI that connect the microcontroller to the converters.
pub struct Wires {
    bus: Bus,
    /// Chip selects, in the order of the chain. The DOUT of chip 0 drives MISO directly.
    selects: [Line; CHIPS],
    start: Line,
    reset: Line,
    drdy: ExtiInput<'static, Blocking>,
}

/// Output of the microcontroller to the converters; `None` for a signal that the board has wired to
/// its level at rest.
struct Line(Option<Output<'static>>);

impl ErrorType for Line {
    type Error = Infallible;
}

impl OutputPin for Line {
    fn set_low(&mut self) -> Result<(), Infallible> {
        if let Some(pin) = &mut self.0 {
            pin.set_low();
        }
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        if let Some(pin) = &mut self.0 {
            pin.set_high();
        }
        Ok(())
    }
}

type WiredChain = Chain<Bus, Line, Delay, CHIPS>;

impl Wires {
    /// Configures the pins so that the chain is at rest: deselected, stopped and not in reset.
    ///
    /// All chips share SPI, START and RESET. Only chip 0's DRDY is connected, to one of EXTI's
    /// lines 5 to 9. The first chip select belongs to chip 0, whose DOUT drives MISO directly. Chip
    /// selects beyond the model's chips stay unused.
    ///
    /// Does not compile for a model with more chips than the board has chip selects.
    pub fn new<DrdyPin: Pin + ExtiPin, const SELECTS: usize>(
        bus: Bus,
        selects: [Peri<'static, AnyPin>; SELECTS],
        [start, reset]: [Peri<'static, AnyPin>; 2],
        drdy: Peri<'static, DrdyPin>,
        drdy_line: Peri<'static, DrdyPin::ExtiChannel>,
    ) -> Self {
        Self {
            bus,
            selects: chain_selects(selects),
            start: Line(Some(Output::new(start, Level::Low, Speed::Low))),
            reset: Line(Some(Output::new(reset, Level::High, Speed::Low))),
            drdy: ExtiInput::new_blocking(drdy, drdy_line, Pull::Up, TriggerEdge::Falling),
        }
    }

    /// Configures the pins as [`Self::new`] does, on a board that has wired START low and RESET
    /// high.
    ///
    /// Does not compile for a model whose converters are not controlled by commands.
    pub fn without_start_and_reset<DrdyPin: Pin + ExtiPin, const SELECTS: usize>(
        bus: Bus,
        selects: [Peri<'static, AnyPin>; SELECTS],
        drdy: Peri<'static, DrdyPin>,
        drdy_line: Peri<'static, DrdyPin::ExtiChannel>,
    ) -> Self {
        const {
            assert!(
                matches!(CONVERTER_SETTINGS.control, Control::Commands),
                "this board connects neither START nor RESET: CORTICODE_ARTIFACT must name a model with \
                 `control = \"commands\"` in `[adc]`"
            );
        }
        Self {
            bus,
            selects: chain_selects(selects),
            start: Line(None),
            reset: Line(None),
            drdy: ExtiInput::new_blocking(drdy, drdy_line, Pull::Up, TriggerEdge::Falling),
        }
    }

    /// Returns the chain, and the DRDY input with its interrupt disabled.
    fn into_chain(mut self) -> (WiredChain, ExtiInput<'static, Blocking>) {
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

/// Returns the deselected chip selects of the chain: the board's first `CHIPS` chip selects.
fn chain_selects<const SELECTS: usize>(selects: [Peri<'static, AnyPin>; SELECTS]) -> [Line; CHIPS] {
    const {
        assert!(
            CHIPS <= SELECTS,
            "the model has more converters than the board has chip selects: CORTICODE_ARTIFACT must name \
             a model with fewer channels"
        );
    }
    let mut selects = selects.into_iter();
    array::from_fn(|_| {
        let select = selects.next().expect("at least as many as chips");
        Line(Some(Output::new(select, Level::High, Speed::High)))
    })
}

/// Returns the DRDY input. Before every wait for an edge, it refills the budget of the trigger's
/// interrupt.
fn drdy_edges() -> impl Drdy {
    DrdyEdges(trigger::refill_budget)
}

/// Chain of converters, whose start is repeated until it succeeds. It must be a static: a task that
/// owned it by value would copy it through the task's stack.
pub(crate) struct Adc {
    chain: RetryingSampler<Bus, Line, Delay, CHIPS, FRAME_BYTES>,
    drdy: ExtiInput<'static, Blocking>,
    test: &'static mut SelfTest<CHIPS>,
    /// Outcome of the latest start that was logged: its error, or `None` if it succeeded.
    logged: Option<Error>,
}

impl Adc {
    /// Creates the converter from the wires of a chain that does not run. `test` is the memory of
    /// the self-test.
    pub(crate) fn new(wires: Wires, test: &'static mut SelfTest<CHIPS>) -> Self {
        let (chain, drdy) = wires.into_chain();
        let sampler = Sampler::new(chain, CONVERTER_SETTINGS);
        Self {
            chain: RetryingSampler::new(sampler, deadlines::CONVERTERS_RETRY.as_micros()),
            drdy,
            test,
            logged: None,
        }
    }

    /// Sets up the chain and starts it. If `is_cold` is true, first waits for the time that the
    /// converters need after power-on. A failure is logged, and every sample is then flagged.
    pub(crate) async fn start(&mut self, is_cold: bool) {
        self.drdy.enable_interrupt();
        self.chain.start(is_cold, &mut drdy_edges()).await;
        self.log();
    }

    /// Logs the outcome of the chain's last start.
    fn log(&mut self) {
        self.logged = self.chain.failure().copied();
        match self.logged {
            None => info!("{} converters run", CHIPS),
            Some(error) => error!("{}", Display2Format(&error)),
        }
    }

    /// Copies the counts of the latest sample to `sample`, and returns the sample's time and
    /// status.
    fn conversion(
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
            // Use the larger count: an edge that occurred while no task waited for it also leaves a
            // gap in the readings, and a sum would count this edge twice.
            missed: edge.missed.max(reading.missed),
            status_bad: !reading.is_sound(),
            lead_off: reading.lead_off(),
            excited: self.chain.sampler().is_excited(),
        }
    }
}

impl Converter for &mut Adc {
    async fn next(&mut self, sample: &mut Sample) -> Conversion {
        let (reading, edge) = self.chain.next(&mut drdy_edges()).await;
        if self.chain.failure() != self.logged.as_ref() {
            self.log();
        }
        self.conversion(&reading, sample, edge)
    }

    #[cfg(feature = "impedance")]
    async fn set_excitation(&mut self, on: bool) {
        let channels = if on { device::EXCITED } else { 0 };
        self.chain.switch_excitation(channels, &mut drdy_edges()).await;
    }

    fn status(&self) -> Option<link::Converters> {
        let sampler = self.chain.sampler();
        Some(device::converters_message(
            self.chain.failure(),
            sampler.millihertz(),
            sampler.last(),
            sampler.counters(),
        ))
    }

    /// Runs the self-test. The test ends with a new set-up and start of the chain, even if the
    /// previous start had failed.
    async fn self_test(&mut self, alive: impl FnMut()) {
        self.chain.sampler_mut().self_test(self.test, &mut drdy_edges(), alive).await;
        let failure = self.test.report().not_restored;
        self.chain.restarted(failure, &mut drdy_edges());
        self.log();
    }

    fn self_test_result(&self) -> Option<link::SelfTest> {
        Some(device::self_test_message(self.test.report()))
    }
}
