//! The simulated converters, behind the driver that a board uses.

use std::sync::{Arc, Mutex, PoisonError};

use ads1299::{
    CHANNELS, Error, Reading, SILENCE, Sampler, SelfTest, SelfTestReport, Settings, frame_bytes,
    simulation::{
        Electrodes, Options, SimulatedBus, SimulatedDelay, SimulatedLine, SimulatedReady,
        Simulation, finish,
    },
};
use pipeline::Sample;

use crate::{Faults, fault::Change};

/// Converters in the chain.
pub const CHIPS: usize = 8;

const _: () = assert!(model::CHANNELS == CHIPS * CHANNELS);

/// From one sample to the next in the chain's own time, ns: 4096 cycles of 2^21 Hz. What the model
/// calls its rate is another matter: it belongs to the device's time.
const PERIOD_NS: u64 = 1_953_125;

/// Samples per second of the chain's own time, Hz.
const RATE_HZ: u64 = 512;

type Counts = [[i32; CHANNELS]; CHIPS];

type Simulated = Sampler<
    SimulatedBus<CHIPS>,
    SimulatedLine<CHIPS>,
    SimulatedDelay<CHIPS>,
    CHIPS,
    { frame_bytes(CHIPS) },
>;

/// A chain of eight simulated converters, and the driver that reads them: counts go in as what the
/// electrodes deliver, and come out of the driver's decoder.
///
/// The chain's time is virtual: a period passes with each sample that is delivered, whatever the
/// device's clock says.
#[derive(Debug)]
pub struct Converters {
    simulation: Simulation<CHIPS>,
    sampler: Simulated,
    drdy: SimulatedReady<CHIPS>,
    /// What the electrodes deliver at the next conversion.
    electrodes: Arc<Mutex<Counts>>,
    faults: Faults,
    /// Samples delivered.
    delivered: u64,
    /// When the edge of the sample in work is due; none before the first.
    due_ns: Option<u64>,
    /// Whether the sample in work has been read or given up.
    is_done: bool,
    /// Whether an edge has come in this period.
    came: bool,
    /// Periods without an edge in a row.
    silent: u32,
    /// Why the chain did not come up as it should.
    failure: Option<Error>,
}

/// A sample that was read, or one that stands for those that do not come.
#[derive(Clone, Copy, Debug)]
pub struct Converted {
    /// The counts; those of before where a chip is bad.
    pub sample: Sample,
    /// What was found.
    pub reading: Reading<CHIPS>,
    /// By how much it came before it was due, us of device time: a chain that is too fast.
    pub early_us: u64,
}

impl Converters {
    /// Power on, with what is broken from the beginning and what is to break.
    pub fn new(faults: Faults) -> Self {
        let electrodes = Arc::new(Mutex::new([[0; CHANNELS]; CHIPS]));
        let delivered = electrodes.clone();
        let deliver = Electrodes::counts(move |_, counts| {
            *counts = *delivered.lock().unwrap_or_else(PoisonError::into_inner);
        });
        let simulation = Simulation::new(Options::default(), deliver);
        let sampler = Sampler::new(simulation.chain(), Settings::EEG.with_lead_off());
        let drdy = simulation.drdy();
        let mut converters = Self {
            simulation,
            sampler,
            drdy,
            electrodes,
            faults,
            delivered: 0,
            due_ns: None,
            is_done: true,
            came: false,
            silent: 0,
            failure: None,
        };
        converters.break_and_mend();
        let begun = finish(converters.sampler.begin(|| ()));
        converters.failure = begun.and_then(Result::err);
        converters
    }

    /// Why the chain did not come up as it should; the driver's own words.
    pub const fn failure(&self) -> Option<Error> {
        self.failure
    }

    /// How the chain is, for the host.
    pub fn message(&self) -> link::Converters {
        let sampler = &self.sampler;
        device::converters(
            self.failure.as_ref(),
            sampler.millihertz(),
            sampler.last(),
            sampler.counters(),
        )
    }

    /// Lets a period begin at whose end the electrodes deliver a sample; [`Self::take`] has it then.
    pub fn deliver(&mut self, sample: &Sample) {
        self.break_and_mend();
        self.delivered += 1;
        let mut electrodes = self
            .electrodes
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        electrodes
            .as_flattened_mut()
            .copy_from_slice(&sample.counts);
        drop(electrodes);
        // The first one comes when the filter has settled; of a chain that does not run none does.
        let first_ns = || {
            let now_ns = self.simulation.time_us() * 1_000;
            Some(self.simulation.next_edge_ns().unwrap_or(now_ns + PERIOD_NS))
        };
        let next_ns = |due_ns| Some(due_ns + PERIOD_NS);
        self.due_ns = self.due_ns.map_or_else(first_ns, next_ns);
        self.is_done = false;
        self.came = false;
    }

    /// The next sample of this period, as the driver reads it: one, but none where an edge is missing,
    /// and two of a chain that is twice as fast.
    pub fn take(&mut self) -> Option<Converted> {
        let due_ns = self.due_ns.filter(|_| !self.is_done)?;
        if let Some(edge_ns) = self.simulation.pass_to_edge(due_ns) {
            self.came = true;
            self.silent = 0;
            let reading = finish(self.sampler.read(edge_ns / 1_000));
            let early_ns = due_ns.saturating_sub(edge_ns);
            let early_us = early_ns * RATE_HZ / u64::from(model::ADC_RATE_HZ) / 1_000;
            return reading.map(|reading| self.converted(reading, early_us));
        }
        self.is_done = true;
        if self.came {
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

    fn converted(&self, reading: Reading<CHIPS>, early_us: u64) -> Converted {
        let mut sample = Sample::default();
        let counts = self.sampler.counts().as_flattened();
        sample.counts.copy_from_slice(counts);
        Converted {
            sample,
            reading,
            early_us,
        }
    }

    /// The driver's whole self-test; the chain converts again afterwards.
    pub fn self_test(&mut self) -> SelfTestReport<CHIPS> {
        let mut test = Box::new(SelfTest::new());
        let simulation = &self.simulation;
        let now_us = || simulation.time_us();
        let run = self
            .sampler
            .self_test(&mut test, &mut self.drdy, now_us, || ());
        // Time is virtual: it does not wait.
        finish(run);
        self.due_ns = None;
        self.silent = 0;
        test.report().clone()
    }

    /// What the driver has counted.
    pub const fn sampler(&self) -> &Simulated {
        &self.sampler
    }

    fn break_and_mend(&mut self) {
        for change in self.faults.at(self.delivered) {
            match change {
                Change::Break(chip, fault) => self.simulation.inject(chip, fault),
                Change::Mend(chip) => self.simulation.repair(chip),
                Change::Electrode { channel, on } => {
                    let (chip, channel) = (channel / CHANNELS, channel % CHANNELS);
                    self.simulation.set_electrode(chip, channel, true, on);
                }
            }
        }
    }
}
