//! Retries: supplies that come late or fail, and a chip that stays broken.

use std::vec::Vec;

use crate::bus::Drdy as _;
use crate::decoder::frame_bytes;
use crate::reading::Reading;
use crate::retrying_sampler::RetryingSampler;
use crate::sampler::Sampler;
use crate::settings::Settings;
use crate::simulation::{
    Electrodes, Event, Fault, Options, SimulatedBus, SimulatedDelay, SimulatedLine, SimulatedReady,
    Simulation, finish,
};

const CHIPS: usize = 8;
const RETRY_US: u64 = 5_000_000;
const PERIOD_US: u64 = 1_953;

type Retrying =
    RetryingSampler<SimulatedBus<CHIPS>, SimulatedLine<CHIPS>, SimulatedDelay<CHIPS>, CHIPS, 217>;

struct Bench {
    simulation: Simulation<CHIPS>,
    chain: Retrying,
    drdy: SimulatedReady<CHIPS>,
}

impl Bench {
    fn new(prepare: impl FnOnce(&Simulation<CHIPS>)) -> Self {
        let simulation = Simulation::new(Options::default(), Electrodes::silent());
        prepare(&simulation);
        let sampler = Sampler::new(simulation.chain(), Settings::EEG);
        let mut chain = RetryingSampler::new(sampler, RETRY_US);
        let mut drdy = simulation.drdy();
        finish(chain.start(true, &mut drdy)).unwrap();
        Self { simulation, chain, drdy }
    }

    /// Returns the readings until `us` with the times of their edges. Asserts that each reading
    /// comes less than five periods after the previous one, and less than one period after its
    /// edge.
    fn until(&mut self, us: u64) -> Vec<(Reading<CHIPS>, u64)> {
        let mut found = Vec::new();
        let mut before_us = self.drdy.now_us();
        while before_us < us {
            let (reading, edge) = finish(self.chain.next(&mut self.drdy)).unwrap();
            let now_us = self.drdy.now_us();
            assert!(now_us - before_us < 5 * PERIOD_US, "at {now_us} us");
            assert!(now_us - edge.us < PERIOD_US, "late at {now_us} us");
            found.push((reading, edge.us));
            before_us = now_us;
        }
        found
    }

    fn resets(&self) -> usize {
        let events = self.simulation.events();
        let is_reset = |(_, event): &&(u64, Event)| *event == Event::Reset;
        events.iter().filter(is_reset).count()
    }
}

/// Returns the number of missed samples that the readings report.
fn missed(found: &[(Reading<CHIPS>, u64)]) -> u32 {
    found.iter().map(|(reading, _)| reading.missed).sum()
}

/// Asserts that the time stamps are about one period apart: none omitted, none repeated.
fn assert_rhythm(found: &[(Reading<CHIPS>, u64)]) {
    for pair in found.windows(2) {
        let [(_, before), (_, after)] = pair else {
            continue;
        };
        // Where real samples follow flagged ones, the interval may differ from the period, by less
        // than one period.
        let interval = after - before;
        assert!((1..2 * PERIOD_US).contains(&interval), "{interval} us at {after}");
    }
}

#[test]
fn a_chain_whose_power_comes_late_streams_without_a_self_test() {
    let mut bench = Bench::new(Simulation::power_off);
    assert!(bench.chain.failure().is_some());
    let found = bench.until(9_000_000);
    assert!(found.iter().all(|(reading, _)| reading.bad == 0xFF));
    assert!(bench.resets() > 1, "it was tried again");
    bench.simulation.power_on();
    // Worst case: an attempt has just started when the supplies return. It fails, and a whole
    // attempt follows after the retry time.
    let found = [found, bench.until(9_000_000 + RETRY_US + 3_000_000)].concat();
    assert!(found.last().is_some_and(|(reading, _)| reading.is_sound()));
    assert_eq!(bench.chain.failure(), None);
    assert_rhythm(&found);
    // After the failed start no sample comes: the chain counts as silent from the fourth period on,
    // and the three periods before count as missed.
    assert_eq!(missed(&found), 3);
    assert_eq!(bench.simulation.violations(), 0);
}

#[test]
fn a_chain_that_loses_its_power_while_it_runs_comes_back() {
    let mut bench = Bench::new(|_| ());
    let running = bench.until(3_000_000);
    assert!(running.iter().all(|(reading, _)| reading.is_sound()));
    bench.simulation.power_off();
    let off = bench.until(4_000_000);
    assert_eq!(missed(&off), 3, "until it is called a silence");
    // START is still high, so the chips convert with their reset values, at 256 Hz, and their
    // frames look valid.
    bench.simulation.power_on();
    let found = bench.until(4_000_000 + RETRY_US + 3_000_000);
    assert!(found.iter().any(|(reading, _)| reading.missed == 1));
    assert!(found.last().is_some_and(|(reading, _)| reading.is_sound()));
    assert_eq!(missed(&found[found.len() - 500..]), 0);
    assert_eq!(bench.simulation.violations(), 0);
}

#[test]
fn a_broken_chip_costs_the_others_no_sample() {
    for fault in [Fault::Dead, Fault::WrongId(0x3C), Fault::StuckData] {
        let mut bench = Bench::new(|simulation| simulation.inject(5, fault));
        let resets = bench.resets();
        let found = bench.until(20_000_000);
        // Stuck data can be detected only from the chip's second sample on, so the first readings
        // are skipped.
        let is_broken = |(reading, _): &(Reading<CHIPS>, u64)| {
            reading.bad.trailing_zeros() == 5 && reading.missed == 0
        };
        assert!(found.iter().skip(8).all(is_broken), "{fault:?}");
        assert_eq!(bench.resets(), resets, "{fault:?}");
    }
}

#[test]
fn a_chain_without_its_first_chip_is_retried_without_delaying_samples() {
    let mut bench = Bench::new(|simulation| simulation.inject(0, Fault::Dead));
    let found = bench.until(14_000_000);
    assert!(found.iter().all(|(reading, _)| reading.bad == 0xFF));
    assert!(bench.resets() >= 3);
    assert_rhythm(&found);
    // The chip has its reset values: it converts at 256 Hz until the chain is brought up again.
    bench.simulation.repair(0);
    let found = bench.until(23_000_000);
    assert!(found.last().is_some_and(|(reading, _)| reading.is_sound()));
    assert_eq!(missed(&found[found.len() - 500..]), 0);
    assert_eq!(bench.simulation.violations(), 0);
}

#[test]
fn a_loss_of_supply_clears_the_registers_and_restarts_the_wait_for_a_reset() {
    let mut bench = super::Bench::<2, { frame_bytes(2) }>::silent(Options::default());
    let simulation = bench.simulation.clone();
    assert!(simulation.next_edge_ns().is_some());
    simulation.power_off();
    assert_eq!(simulation.next_edge_ns(), None);
    // Without power there are no timing violations, and no chip answers.
    assert!(bench.start().is_err());
    assert_eq!(simulation.violations(), 0);
    simulation.power_on();
    simulation.pass_us(50_000);
    // 2^18 tCLK at 2^21 Hz are 125 ms, so a reset after 50 ms is too early.
    let mut lines = simulation.chain();
    super::run(lines.reset_now(Settings::EEG));
    assert!(simulation.violations() > 0);
    assert_eq!(bench.start(), Ok(()));
}
