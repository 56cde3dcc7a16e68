//! A dead chip 0, wrong rates, and a frame that is read too late are flagged.

use std::format;
use std::string::{String, ToString};

use super::Bench;
use crate::bus::Drdy as _;
use crate::clock::Clock;
use crate::decoder::frame_bytes;
use crate::ready::{Edge, RateError, ReadyMeter};
use crate::settings::{Rate, Settings};
use crate::simulation::{Electrodes, Fault, Options, finish};

const CHIPS: usize = 8;

#[test]
fn chip_0_dies_and_drdy_with_it() {
    let mut bench = Bench::<CHIPS, { frame_bytes(CHIPS) }>::silent(Options::default());
    bench.simulation.inject(0, Fault::Dead);
    assert_eq!(finish(bench.drdy.next_until(10_000_000)).unwrap(), None);
    let reading = finish(bench.sampler.read(bench.simulation.time_us())).unwrap();
    let status = reading.status.expect("a frame");
    assert_eq!((status.words[0].0, status.bad & 1), (0, 1));
}

/// Measures the rate of a chain over 64 edges of DRDY and returns the text of the rate error.
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
    let slow = Options { clock_hz: 2_048_000, ..Options::default() };
    // Over 63 periods of 1024 Hz with edges rounded to whole microseconds, the measured rate is
    // 1023.990 or 1024.007 Hz. The test compares only the leading digits, which are the same for
    // both rates.
    let doubled = (Options::default(), Some(Fault::DoubleRate));
    for ((options, fault), hz, cause) in [
        (doubled, "102", " Hz, and 512.000 Hz is set, 2 times as fast: "),
        ((slow, None), "500.0", " Hz, and 512.000 Hz is set: the clock"),
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
    // The burst takes 108 us and starts 50 us before the end of the next conversion, which
    // therefore overwrites the frame while it is read.
    bench.simulation.pass_us(1953 - 50);
    let reading = finish(bench.sampler.read(edge_us)).unwrap();
    let status = reading.status.unwrap();
    assert!(!status.is_sound());
    assert!(status.bad & 0x80 != 0, "{:08b}", status.bad);
}
