//! Chains that are wired or controlled in other ways than the default one.

use super::{Bench, run};
use crate::decoder::{CHANNELS, frame_bytes};
use crate::error::Error;
use crate::register::Register;
use crate::settings::{Control, Settings, Wiring};
use crate::simulation::{Electrodes, Event, Fault, Options};

const BYTES: usize = frame_bytes(4);

/// Creates a chain of four chips with different counts on all channels.
fn bench(wired: Wiring, settings: Settings) -> Bench<4, BYTES> {
    let options = Options { wiring: wired, ..Options::default() };
    Bench::new(options, Electrodes::counts(unlike), settings)
}

fn unlike(sample: u64, counts: &mut [[i32; CHANNELS]; 4]) {
    for (place, count) in (0..).zip(counts.as_flattened_mut()) {
        *count = 1_000 * place + i32::try_from(sample).unwrap() - 9_000;
    }
}

const CASCADED: Settings = Settings { wiring: Wiring::Cascaded, ..Settings::EEG };

#[test]
fn cascaded_chips_are_read_one_by_one_without_contention() {
    let mut bench = bench(Wiring::Cascaded, CASCADED);
    bench.start().unwrap();
    for sample in 0..100 {
        let reading = bench.next();
        assert!(reading.is_sound() && reading.missed == 0, "{reading:?}");
        let mut expected = [[0; CHANNELS]; 4];
        unlike(sample, &mut expected);
        assert_eq!(bench.sampler.counts(), &expected, "sample {sample}");
    }
    assert_eq!(bench.simulation.violations(), 0);
    // Unlike in a daisy chain, a chip without power hides no other chip.
    bench.simulation.inject(1, Fault::Dead);
    assert_eq!(bench.next().bad, 0b10);
}

#[test]
fn selecting_cascaded_chips_together_is_contention() {
    let mut bench = bench(Wiring::Cascaded, Settings::EEG);
    let _ = bench.start();
    assert!(bench.simulation.violations() > 0);
}

#[test]
fn read_back_resistors_that_are_too_large_are_reported_as_unfit_chips() {
    let start = |ohms| {
        let options = Options { read_back_ohms: Some(ohms), ..Options::default() };
        Bench::<8, { frame_bytes(8) }>::new(options, Electrodes::silent(), Settings::EEG).start()
    };
    assert_eq!(start(22_000), Ok(()));
    let error = start(47_000).expect_err("a level between 0 and 1");
    assert!(matches!(error, Error::WrongId { chip: 1, .. }), "{error}");
}

#[test]
fn a_chain_is_reset_started_and_stopped_by_opcodes() {
    let settings = Settings { control: Control::Commands, ..Settings::EEG };
    let mut bench = bench(Wiring::Daisy, settings);
    bench.start().unwrap();
    assert!(bench.next().is_sound());
    run(bench.sampler.chain.halt(settings));
    assert_eq!(bench.simulation.next_edge_ns(), None);
    // A second start finds the registers as a reset leaves them, and writes them again.
    bench.start().unwrap();
    assert!(bench.next().is_sound());
    let mut read = crate::image::Image([0; Register::COUNT]);
    run(bench.sampler.chain.halt(settings));
    run(bench.sampler.chain.read_part(3, &mut read, 0..Register::COUNT));
    assert_eq!(read, settings.image(3));
    assert_eq!(bench.simulation.violations(), 0);
    let is_pin = |(_, event): &(u64, Event)| !matches!(event, Event::Command { .. });
    assert!(!bench.simulation.events().iter().any(is_pin));
}
