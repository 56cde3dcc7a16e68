//! Tests of the driver on the simulated chain.

mod decoding;
mod faults;
mod impedance;
mod retrying;
mod sampling;
mod self_test;
mod start_up;
mod streams;
mod whole_self_test;
mod wirings;

use crate::bus::Drdy as _;
use crate::error::Error;
use crate::reading::Reading;
use crate::sampler::Sampler;
use crate::settings::Settings;
use crate::simulation::{
    Electrodes, Options, SimulatedBus, SimulatedDelay, SimulatedLine, SimulatedReady, Simulation,
    finish,
};

/// A simulated chain with its driver; a test reads one sample per edge of DRDY. `BYTES` is the
/// length of the chain's frames.
struct Bench<const CHIPS: usize, const BYTES: usize> {
    simulation: Simulation<CHIPS>,
    sampler:
        Sampler<SimulatedBus<CHIPS>, SimulatedLine<CHIPS>, SimulatedDelay<CHIPS>, CHIPS, BYTES>,
    drdy: SimulatedReady<CHIPS>,
}

impl<const CHIPS: usize, const BYTES: usize> Bench<CHIPS, BYTES> {
    /// Creates a chain that has power but has not been brought up.
    fn new(options: Options, electrodes: Electrodes<CHIPS>, settings: Settings) -> Self {
        let simulation = Simulation::new(options, electrodes);
        Self {
            sampler: Sampler::new(simulation.chain(), settings),
            drdy: simulation.drdy(),
            simulation,
        }
    }

    /// Creates a running chain with [`Settings::EEG`] whose electrodes are at 0 V.
    fn silent(options: Options) -> Self {
        let mut bench = Self::new(options, Electrodes::silent(), Settings::EEG);
        bench.start().unwrap();
        bench
    }

    fn start(&mut self) -> Result<(), Error> {
        finish(self.sampler.start(|| ())).unwrap()
    }

    /// Waits for the next edge of DRDY and returns its time in microseconds.
    fn edge_us(&mut self) -> u64 {
        let end_us = self.drdy.now_us() + 1_000_000;
        let edge = finish(self.drdy.next_until(end_us)).unwrap();
        edge.expect("an edge").us
    }

    fn next(&mut self) -> Reading<CHIPS> {
        let edge_us = self.edge_us();
        finish(self.sampler.read(edge_us)).unwrap()
    }
}

/// Runs a future of the driver to its end; it must succeed.
fn run<T, E: core::fmt::Debug>(future: impl Future<Output = Result<T, E>>) -> T {
    finish(future).expect("it ends").expect("it succeeds")
}
