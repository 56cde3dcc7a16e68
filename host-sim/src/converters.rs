//! Simulated converters, read by the driver that boards use.

use std::sync::{Arc, Mutex, PoisonError};

use ads1299::{
    CHANNELS, Error, Reading, SILENCE, Sampler, SelfTest, SelfTestReport, Settings, frame_bytes,
    simulation::{
        Electrodes, Options, SimulatedBus, SimulatedDelay, SimulatedLine, SimulatedReady,
        Simulation, finish,
    },
};
use device::{CHIPS, CONVERTER_SETTINGS};
use pipeline::{ELECTRODES, Sample};

use crate::fault::{Change, Faults};

type Counts = [[i32; CHANNELS]; CHIPS];

type Simulated = Sampler<
    SimulatedBus<CHIPS>,
    SimulatedLine<CHIPS>,
    SimulatedDelay<CHIPS>,
    CHIPS,
    { frame_bytes(CHIPS) },
>;

/// A chain of simulated converters with the driver that reads them.
///
/// Samples are applied to the simulated electrodes and read back by the driver. The chain's time is
/// virtual: each applied sample advances it by one period, independently of device time.
#[derive(Debug)]
pub struct Converters {
    simulation: Simulation<CHIPS>,
    sampler: Simulated,
    drdy: SimulatedReady<CHIPS>,
    /// Input of each channel, in counts, that the next conversion delivers.
    electrodes: Arc<Mutex<Counts>>,
    faults: Faults,
    /// Number of sample periods started, which determines the faults that are due.
    periods: u64,
    /// Time at which the first DRDY edge after start-up or after the last self-test is due, ns of
    /// the chain's time, and the number of its sample period; `None` before that period.
    first_edge: Option<(u64, u64)>,
    /// True if all samples of the current period have been read.
    is_done: bool,
    /// True if a DRDY edge has occurred in the current period.
    edge_seen: bool,
    /// Consecutive periods without a DRDY edge; saturates at `SILENCE + 1`.
    silent: u32,
    /// Fault that the driver found when it initialised the chain; `None` if there was none.
    failure: Option<Error>,
}

/// Returns the duration of `periods` sample periods, ns, rounded up.
fn periods_ns(periods: u64) -> u64 {
    let settings = CONVERTER_SETTINGS;
    let cycles = u128::from(periods) * u128::from(settings.rate.divider());
    let ns = (cycles * 1_000_000_000).div_ceil(settings.clock.hz().into());
    u64::try_from(ns).unwrap_or(u64::MAX)
}

/// A sample from the driver, or a repetition of the last sample that replaces missing samples.
#[derive(Clone, Copy, Debug)]
pub struct ConvertedSample {
    /// Counts of all channels. The channels of a bad chip repeat the chip's last good sample.
    pub sample: Sample,
    /// Status of the chips, and number of samples missed before this one.
    pub reading: Reading<CHIPS>,
    /// Time by which the DRDY edge came too early, microseconds of device time; 0 unless the chain
    /// runs too fast.
    pub early_us: u64,
}

impl Converters {
    /// Powers on the chain with the faults that are present at power-on, and initialises it.
    /// [`Self::failure()`] returns the fault that the initialisation found, if any.
    pub fn new(faults: Faults) -> Self {
        let electrodes = Arc::new(Mutex::new([[0; CHANNELS]; CHIPS]));
        let at_electrodes = electrodes.clone();
        let deliver = Electrodes::counts(move |_, counts| {
            *counts = *at_electrodes.lock().unwrap_or_else(PoisonError::into_inner);
        });
        let options = Options {
            clock_hz: CONVERTER_SETTINGS.clock.hz(),
            wiring: CONVERTER_SETTINGS.wiring,
            ..Options::default()
        };
        let simulation = Simulation::new(options, deliver);
        let settings = Settings { lead_off: true, ..CONVERTER_SETTINGS };
        let sampler = Sampler::new(simulation.chain(), settings);
        let drdy = simulation.drdy();
        let mut converters = Self {
            simulation,
            sampler,
            drdy,
            electrodes,
            faults,
            periods: 0,
            first_edge: None,
            is_done: true,
            edge_seen: false,
            silent: 0,
            failure: None,
        };
        converters.apply_faults();
        let started = finish(converters.sampler.start(|| ()));
        converters.failure = started.and_then(Result::err);
        converters
    }

    /// Sets the impedance of each electrode, in ohms.
    pub fn set_impedances(&mut self, ohms: &[f64; ELECTRODES]) {
        for (electrode, ohms) in ohms.iter().enumerate() {
            let (chip, channel) = (electrode / CHANNELS, electrode % CHANNELS);
            self.simulation.set_impedance(chip, channel, *ohms);
        }
    }

    /// Returns the fault that the driver found when it initialised the chain.
    pub const fn failure(&self) -> Option<Error> {
        self.failure
    }

    /// Builds the status message for the host.
    pub fn message(&self) -> link::Converters {
        let sampler = &self.sampler;
        device::converters_message(
            self.failure.as_ref(),
            sampler.millihertz(),
            sampler.last(),
            sampler.counters(),
        )
    }

    /// Starts a sample period, in which the chips convert `sample`. [`Self::read`] then returns
    /// what the driver reads in this period.
    pub fn start_period(&mut self, sample: &Sample) {
        self.apply_faults();
        self.periods += 1;
        let mut electrodes = self.electrodes.lock().unwrap_or_else(PoisonError::into_inner);
        electrodes.as_flattened_mut().copy_from_slice(&sample.counts);
        drop(electrodes);
        self.first_edge.get_or_insert_with(|| {
            // The first DRDY edge is due when the chips' filter has settled. If the chips do not
            // convert, the edge counts as due one period from now.
            let edge_ns = self.simulation.next_edge_ns();
            let one_period_on = || self.simulation.time_us() * 1_000 + periods_ns(1);
            (edge_ns.unwrap_or_else(one_period_on), self.periods)
        });
        self.is_done = false;
        self.edge_seen = false;
    }

    /// Returns the next sample of the current period; `None` after the last one. A period has one
    /// sample, but none if a DRDY edge is missing and two if the chain runs twice as fast. From the
    /// [`SILENCE`]th consecutive period without an edge on, each period has one repeated sample.
    pub fn read(&mut self) -> Option<ConvertedSample> {
        let (first_ns, first_period) = self.first_edge.filter(|_| !self.is_done)?;
        let due_ns = first_ns + periods_ns(self.periods - first_period);
        if let Some(edge_ns) = self.simulation.pass_to_edge(due_ns) {
            self.edge_seen = true;
            self.silent = 0;
            let reading = finish(self.sampler.read(edge_ns / 1_000));
            let early_ns = due_ns.saturating_sub(edge_ns);
            return reading.map(|reading| self.converted(reading, early_ns / 1_000));
        }
        self.is_done = true;
        if self.edge_seen {
            return None;
        }
        self.silent = (self.silent + 1).min(SILENCE + 1);
        let missed = match self.silent {
            SILENCE => SILENCE - 1,
            silent if silent > SILENCE => 0,
            _ => return None,
        };
        let reading = self.sampler.silence(missed);
        Some(self.converted(reading, 0))
    }

    fn converted(&self, reading: Reading<CHIPS>, early_us: u64) -> ConvertedSample {
        let mut sample = Sample::default();
        let counts = self.sampler.counts().as_flattened();
        sample.counts.copy_from_slice(counts);
        ConvertedSample { sample, reading, early_us }
    }

    /// Switches the excitation of the electrodes on or off, between two samples.
    pub fn set_excitation(&mut self, on: bool) {
        let channels = if on { device::EXCITED } else { 0 };
        if self.sampler.settings().excited != channels {
            // The simulated bus and pins do not fail.
            let _ = finish(self.sampler.set_excitation(channels));
        }
    }

    /// Returns whether the electrodes carry the excitation.
    pub const fn is_excited(&self) -> bool {
        self.sampler.is_excited()
    }

    /// Runs the driver's complete self-test in virtual time; the chain then resumes conversion.
    pub fn run_self_test(&mut self) -> SelfTestReport<CHIPS> {
        let mut test = Box::new(SelfTest::new());
        finish(self.sampler.self_test(&mut test, &mut self.drdy, || ()));
        self.first_edge = None;
        self.silent = 0;
        test.report().clone()
    }

    /// Returns the driver, which holds the counters of samples and errors.
    pub const fn sampler(&self) -> &Simulated {
        &self.sampler
    }

    fn apply_faults(&mut self) {
        for change in self.faults.take_due(self.periods) {
            match change {
                Change::Inject(chip, fault) => self.simulation.inject(chip, fault),
                Change::Repair(chip) => self.simulation.repair(chip),
                Change::Electrode { channel, on } => {
                    let (chip, channel) = (channel / CHANNELS, channel % CHANNELS);
                    self.simulation.set_electrode(chip, channel, on);
                }
            }
        }
    }
}
