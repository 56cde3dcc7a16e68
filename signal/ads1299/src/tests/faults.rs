//! Each fault of a chip is flagged within one frame, with the index of the chip.

use std::format;
use std::string::{String, ToString};

use super::Bench;
use crate::bus::Drdy as _;
use crate::clock::Clock;
use crate::decoder::{Alignment, FrameStatus, frame_bytes};
use crate::reading::ChipFault;
use crate::ready::{Edge, RateError, ReadyMeter};
use crate::settings::{Rate, Settings};
use crate::simulation::{Electrodes, Fault, Options, finish};

const CHIPS: usize = 8;

/// Streams 20 valid frames and then injects `fault` into `chip`. Returns the status of each of the
/// next two frames.
fn next_frames(alignment: Alignment, chip: usize, fault: Fault) -> [FrameStatus<CHIPS>; 2] {
    let options = Options {
        alignment,
        ..Options::default()
    };
    let mut bench = Bench::<CHIPS, { frame_bytes(CHIPS) }>::silent(options);
    for _ in 0..20 {
        assert!(bench.next().is_sound());
    }
    bench.simulation.inject(chip, fault);
    [(); 2].map(|()| bench.next().status.expect("a frame"))
}

#[test]
fn every_fault_is_named_from_its_first_frame_on() {
    let wrong = (0..16).filter(|nibble| *nibble != 0b1100);
    let wrong = wrong.map(|nibble| (Fault::WrongNibble(nibble), None, false));
    let faults = [
        (Fault::Dead, Some(ChipFault::OnlyZeros), true),
        (Fault::ShiftedBit, Some(ChipFault::Late(1)), true),
        (Fault::StuckData, Some(ChipFault::Repeated), false),
    ];
    for (fault, found, blocks) in faults.into_iter().chain(wrong) {
        for alignment in [Alignment::Packed, Alignment::Spaced] {
            // A dead chip 0 is not tested here: its DRDY stays high, so no frame is read.
            for chip in usize::from(fault == Fault::Dead)..CHIPS {
                for status in next_frames(alignment, chip, fault) {
                    let (first, named) = status.faults().next().expect("a fault");
                    assert_eq!(first, chip, "{fault:?} {alignment:?}");
                    assert!(
                        found.is_none_or(|found| found == named),
                        "{fault:?} {named:?}"
                    );
                    // A dead or shifted chip damages the data of the chips after it, not of those
                    // before it.
                    let after = (0xFF_u8 >> chip) << chip;
                    let expected = if blocks { after } else { 1 << chip };
                    assert_eq!(status.bad | status.repeated, expected, "{fault:?} {chip}");
                    if let Fault::WrongNibble(nibble) = fault {
                        assert_eq!(status.words[chip].nibble(), nibble);
                    }
                }
            }
        }
    }
}

#[test]
fn chip_0_dies_and_drdy_with_it() {
    let mut bench = Bench::<CHIPS, { frame_bytes(CHIPS) }>::silent(Options::default());
    bench.simulation.inject(0, Fault::Dead);
    assert_eq!(finish(bench.drdy.next_until(10_000_000)).unwrap(), None);
    let status = finish(bench.sampler.read(bench.simulation.time_us()))
        .unwrap()
        .status;
    let fault = status.unwrap().faults().next();
    assert_eq!(fault, Some((0, ChipFault::OnlyZeros)));
}

/// Measures the rate of a chain over 64 edges of DRDY. Returns the text of the error that is found.
fn wrong_rate(options: Options, fault: Option<Fault>) -> String {
    let silent = Electrodes::silent();
    let mut bench = Bench::<2, { frame_bytes(2) }>::new(options, silent, Settings::EEG);
    if let Some(fault) = fault {
        bench.simulation.inject(0, fault);
    }
    bench.start().unwrap();
    let mut meter = ReadyMeter::new(0, Clock::EEG, Rate::Div4096);
    assert_eq!(meter.check(), Err(RateError::NotMeasured { chip: 0 }));
    for _ in 0..64 {
        meter.edge(bench.edge_us());
    }
    meter.check().expect_err("a wrong rate").to_string()
}

#[test]
fn a_wrong_rate_is_stated_with_its_likely_cause() {
    let slow = Options {
        clock_hz: 2_048_000,
        ..Options::default()
    };
    // 63 periods of 1024 Hz, rounded to whole microseconds, measure as 1023.990 or 1024.007 Hz. The
    // test compares the digits that both have in common.
    let doubled = (Options::default(), Some(Fault::DoubleRate));
    for ((options, fault), hz, cause) in [
        (
            doubled,
            "102",
            " Hz, and 512.000 Hz is set, 2 times as fast: ",
        ),
        (
            (slow, None),
            "500.0",
            " Hz, and 512.000 Hz is set: the clock",
        ),
    ] {
        let text = wrong_rate(options, fault);
        let begin = format!("DRDY of ADS1299 0 comes at {hz}");
        assert!(text.starts_with(&begin) && text.contains(cause), "{text}");
    }
}

#[test]
fn edges_at_any_times_neither_overflow_nor_divide_by_zero() {
    let mut meter = ReadyMeter::new(3, Clock::EEG, Rate::Div128);
    assert_eq!(meter.edge(0), Edge::First);
    assert_eq!(meter.edge(0), Edge::Early);
    assert_eq!(meter.check(), Err(RateError::NotMeasured { chip: 3 }));
    // 153 us is just above 2.5 periods of 61 us: the edge counts as the third, and two are missing.
    assert_eq!(meter.edge(153), Edge::Missed(2));
    assert_eq!(meter.edge(u64::MAX), Edge::Missed(u32::MAX));
    assert_eq!(meter.edge(5), Edge::Early);
    assert!(meter.check().is_err());
}

#[test]
fn a_frame_that_is_read_too_late_is_flagged() {
    let mut bench = Bench::<CHIPS, { frame_bytes(CHIPS) }>::silent(Options::default());
    for _ in 0..3 {
        assert!(bench.next().is_sound());
    }
    let edge_us = bench.edge_us();
    // The burst takes 108 us and starts 50 us before the end of the next conversion, so that
    // conversion overwrites the frame while it is read.
    bench.simulation.pass_us(1953 - 50);
    let reading = finish(bench.sampler.read(edge_us)).unwrap();
    let status = reading.status.unwrap();
    assert!(!status.is_sound());
    assert!(status.bad & 0x80 != 0, "{:08b}", status.bad);
}
