//! Readings of the sampler when chips fail, start and stop.

use super::{Bench, run};
use crate::decoder::{Alignment, CHANNELS, frame_bytes};
use crate::ready::RateError;
use crate::register::Register;
use crate::settings::Settings;
use crate::simulation::{Electrodes, Fault, Options};

const CHIPS: usize = 8;

type Chain = Bench<CHIPS, { frame_bytes(CHIPS) }>;

/// Creates a chain that has not been brought up, with lead-off detection.
fn stopped(alignment: Alignment, electrodes: Electrodes<CHIPS>) -> Chain {
    let options = Options { alignment, ..Options::default() };
    let settings = Settings { lead_off: true, ..Settings::EEG };
    Bench::new(options, electrodes, settings)
}

/// Returns electrodes whose counts encode the numbers of sample, chip and channel.
fn numbered() -> Electrodes<CHIPS> {
    Electrodes::counts(|sample, counts| {
        for (place, count) in (0..).zip(counts.as_flattened_mut()) {
            *count = i32::try_from(sample).unwrap() * 1000 + place + 1;
        }
    })
}

/// Returns the sample number encoded in a chip's counts.
fn number(counts: &[i32; CHANNELS]) -> i32 {
    counts[0] / 1000
}

fn running(alignment: Alignment) -> Chain {
    let mut bench = stopped(alignment, numbered());
    bench.start().unwrap();
    for sample in 0..20 {
        let reading = bench.next();
        assert!(reading.is_sound() && reading.missed == 0, "{reading:?}");
        assert_eq!(bench.sampler.counts().map(|chip| number(&chip)), [sample; 8]);
    }
    bench
}

#[test]
fn every_fault_of_a_frame_names_its_chip_and_holds_its_counts() {
    let wrong = (0..16).filter(|nibble| *nibble != 0b1100);
    let faults = [Fault::Dead, Fault::ShiftedBit, Fault::StuckData];
    let faults = faults.into_iter().chain(wrong.map(Fault::WrongNibble));
    for (fault, alignment) in
        faults.flat_map(|fault| [(fault, Alignment::Packed), (fault, Alignment::Spaced)])
    {
        // A dead chip 0 is not tested here: its DRDY stays high, so no frame is read.
        for chip in usize::from(fault == Fault::Dead)..CHIPS {
            let mut bench = running(alignment);
            bench.simulation.inject(chip, fault);
            // A dead or shifted chip also damages the data of the chips after it.
            let blocks = matches!(fault, Fault::Dead | Fault::ShiftedBit);
            let is_bad = |other| other == chip || other > chip && blocks;
            for _ in 0..3 {
                let reading = bench.next();
                for (other, counts) in bench.sampler.counts().iter().enumerate() {
                    let found = (reading.bad >> other & 1 != 0, number(counts) == 19);
                    let expected = (is_bad(other), is_bad(other));
                    assert_eq!(found, expected, "{fault:?} {alignment:?} {chip} {other}");
                }
                if let Fault::WrongNibble(nibble) = fault {
                    assert_eq!(reading.status.unwrap().words[chip].nibble(), nibble);
                }
            }
            bench.simulation.repair(chip);
            assert!(bench.next().is_sound());
            assert_eq!(number(&bench.sampler.counts()[chip]), 23);
            let errors: [u32; CHIPS] = core::array::from_fn(|other| 3 * u32::from(is_bad(other)));
            assert_eq!(bench.sampler.counters().errors, errors);
        }
    }
}

#[test]
fn a_doubled_rate_is_flagged_at_the_first_early_edge_and_counted_for_chip_0() {
    let mut bench = running(Alignment::Spaced);
    bench.simulation.inject(0, Fault::DoubleRate);
    // The first edge ends a conversion that started at the old rate, so it is not flagged yet.
    assert!(bench.next().is_sound());
    for _ in 0..200 {
        let reading = bench.next();
        assert_eq!(reading.bad, 0);
        let Some(RateError::Off { chip: 0, early, .. }) = reading.rate else {
            panic!("{reading:?}");
        };
        assert_eq!(early, 1);
    }
    bench.simulation.repair(0);
    assert!(bench.next().rate.is_some());
    assert!((0..200).all(|_| bench.next().is_sound()));
    assert_eq!(bench.sampler.counters().errors[0], 201);
}

#[test]
fn a_missed_edge_counts_as_a_missed_sample() {
    let mut bench = running(Alignment::Spaced);
    bench.simulation.inject(0, Fault::MissedReady);
    let reading = bench.next();
    assert!(reading.is_sound());
    assert_eq!(reading.missed, 1);
    assert_eq!(number(&bench.sampler.counts()[5]), 21);
    assert_eq!((bench.next().missed, bench.sampler.counters().missed), (0, 1));
}

#[test]
fn the_rate_of_another_oscillator_is_measured_and_flags_no_sample() {
    let options = Options { clock_hz: 2_048_000, ..Options::default() };
    let mut bench = Bench::<1, { frame_bytes(1) }>::silent(options);
    assert!((0..200).all(|_| bench.next().is_sound()));
    let measured = bench.sampler.millihertz().expect("three judgements");
    // Tolerance: the 1 us resolution of both stamps causes an error of up to 16 ppm over 1/8 s,
    // which is 8 mHz at 500 Hz.
    assert!(measured.abs_diff(500_000) <= 10, "{measured}");
}

#[test]
fn a_chain_without_drdy_is_silent_and_all_of_its_chips_are_bad() {
    let mut bench = running(Alignment::Spaced);
    bench.simulation.inject(0, Fault::Dead);
    let reading = bench.sampler.silence(3);
    assert_eq!((reading.bad, reading.missed), (0xFF, 3));
    assert!(!reading.lead_off());
    bench.simulation.repair(0);
    bench.simulation.pass_us(100_000);
    // `silence` has counted the missed periods; the next reading does not count them again.
    assert_eq!(bench.next().missed, 0);
    assert_eq!(bench.sampler.counters().missed, 3);
}

#[test]
fn counts_of_an_unfit_chip_are_never_used_and_those_of_others_are() {
    for (chip, fault) in [(2, Fault::WrongId(0x92)), (5, Fault::Forgets(Register::CH1SET))] {
        let mut bench = stopped(Alignment::Spaced, numbered());
        bench.simulation.inject(chip, fault);
        let error = bench.start().expect_err("a broken chip");
        assert_eq!(error.chip(), Some(u8::try_from(chip).unwrap()), "{error}");
        for sample in 0..5 {
            let reading = bench.next();
            assert_eq!(reading.bad, 1 << chip);
            let numbers = bench.sampler.counts().map(|counts| number(&counts));
            let mut expected = [sample; CHIPS];
            expected[chip] = 0;
            assert_eq!(numbers, expected);
        }
        bench.simulation.repair(chip);
        bench.start().unwrap();
        assert!(bench.next().is_sound());
    }
}

#[test]
fn a_disconnected_electrode_sets_its_bit_and_reads_the_rail_and_is_no_error() {
    let mut bench = running(Alignment::Spaced);
    bench.simulation.set_electrode(3, 6, false);
    let reading = bench.next();
    assert!(reading.is_sound() && reading.lead_off());
    let off: [_; CHIPS] =
        core::array::from_fn(|chip| (reading.off_positive(chip), reading.off_negative(chip)));
    let mut expected = [(0, 0); CHIPS];
    expected[3] = (0x40, 0);
    assert_eq!(off, expected);
    assert_eq!(bench.sampler.counts()[3][6], (1 << 23) - 1);
    bench.simulation.set_electrode(3, 6, true);
    assert!(!bench.next().lead_off());
    // Without lead-off current, a disconnected electrode is not detected.
    let mut bench = Chain::silent(Options::default());
    bench.simulation.set_electrode(3, 6, false);
    assert!(!bench.next().lead_off());
}

#[test]
fn channels_at_a_rail_or_at_zero_do_not_count_as_frozen() {
    let constant = |value: i32, alive: usize| {
        Electrodes::counts(move |_, counts: &mut [[i32; CHANNELS]; CHIPS]| {
            *counts = [[value; CHANNELS]; CHIPS];
            counts[4][..alive].fill(77);
        })
    };
    for value in [0, (1 << 23) - 1, -(1 << 23)] {
        for (alive, flagged_at) in
            [(0, None), (1, Some(5)), (3, Some(2)), (5, Some(1)), (8, Some(1))]
        {
            let mut bench = stopped(Alignment::Spaced, constant(value, alive));
            bench.start().unwrap();
            let found = (0..20).position(|_| bench.next().bad == 1 << 4);
            assert_eq!(found, flagged_at, "{alive} channels alive beside {value}");
        }
    }
}

#[test]
fn a_chain_is_started_stopped_and_set_up_again_at_the_right_speeds() {
    let mut bench = Bench::<2, { frame_bytes(2) }>::silent(Options::default());
    let settings = Settings::EEG;
    for _ in 0..3 {
        let before_us = bench.simulation.time_us();
        bench.edge_us();
        let chain = &mut bench.sampler.chain;
        run(chain.read_frame(&mut [0; frame_bytes(2)], settings.wiring));
        let burst_us = bench.simulation.time_us() - before_us;
        assert!(burst_us < 8_500, "a burst is fast");
        run(chain.halt(settings));
        run(chain.set_up(settings, &mut || ()));
        run(chain.run(settings));
        // The chips are set up while they convert, as when a self-test is requested.
        run(chain.set_up(settings, &mut || ()));
        run(chain.run(settings));
    }
    assert_eq!(bench.simulation.violations(), 0);
}
