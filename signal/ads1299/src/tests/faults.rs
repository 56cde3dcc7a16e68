//! Each fault of a chip is flagged within one frame, with the index of the chip.

use std::string::ToString;
use std::vec::Vec;

use super::Bench;
use crate::bus::Drdy as _;
use crate::clock::Clock;
use crate::decoder::{Alignment, FrameStatus, frame_bytes};
use crate::reading::ChipFault;
use crate::ready::{Edge, RateError, ReadyMeter};
use crate::settings::{Rate, Settings};
use crate::simulation::{Electrodes, Fault, Options, finish};

const CHIPS: usize = 8;

/// Streams 20 valid frames and then injects `fault` into `chip`. Returns the status and the DRDY
/// edge of each of the next `after` frames, and the meter of all edges.
fn next_frames(
    alignment: Alignment,
    chip: usize,
    fault: Fault,
    after: usize,
) -> (Vec<FrameStatus<CHIPS>>, Vec<Edge>, ReadyMeter) {
    let options = Options {
        alignment,
        ..Options::default()
    };
    let mut bench = Bench::<CHIPS, { frame_bytes(CHIPS) }>::silent(options);
    let mut meter = ReadyMeter::new(0, Clock::EEG, Rate::Div4096);
    let (mut statuses, mut edges) = (Vec::new(), Vec::new());
    for n in 0..20 + after {
        if n == 20 {
            bench.simulation.inject(chip, fault);
        }
        let edge_us = bench.edge_us();
        edges.push(meter.edge(edge_us));
        let reading = finish(bench.sampler.read(edge_us)).unwrap();
        statuses.push(reading.status.unwrap());
    }
    assert!(statuses[..20].iter().all(FrameStatus::is_sound));
    assert!(edges[1..20].iter().all(|edge| *edge == Edge::OnTime));
    (statuses.split_off(20), edges.split_off(20), meter)
}

fn first_fault(status: &FrameStatus<CHIPS>) -> Option<(usize, ChipFault)> {
    status.faults().next()
}

#[test]
fn a_chip_that_dies_is_the_first_of_those_without_a_signal() {
    for alignment in [Alignment::Packed, Alignment::Spaced] {
        for chip in 1..CHIPS {
            let (statuses, _, _) = next_frames(alignment, chip, Fault::Dead, 3);
            for status in statuses {
                assert_eq!(first_fault(&status), Some((chip, ChipFault::OnlyZeros)));
                // A dead chip blocks the data of the chips after it, not of those before it.
                assert_eq!(status.bad, (0xFF_u8 >> chip) << chip);
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
    let fault = first_fault(&status.unwrap());
    assert_eq!(fault, Some((0, ChipFault::OnlyZeros)));
}

#[test]
fn stuck_data_are_detected_at_the_first_repetition() {
    for chip in 0..CHIPS {
        let (statuses, _, _) = next_frames(Alignment::Spaced, chip, Fault::StuckData, 3);
        for status in statuses {
            let faults: Vec<_> = status.faults().collect();
            assert_eq!(faults, [(chip, ChipFault::Repeated)]);
        }
    }
}

#[test]
fn a_wrong_status_is_detected_in_its_frame() {
    for chip in 0..CHIPS {
        for nibble in (0..16).filter(|nibble| *nibble != 0b1100) {
            let fault = Fault::WrongNibble(nibble);
            let (statuses, _, _) = next_frames(Alignment::Packed, chip, fault, 2);
            for status in statuses {
                assert_eq!(status.bad, 1 << chip);
                assert_eq!(status.words[chip].nibble(), nibble);
            }
        }
    }
}

#[test]
fn the_first_chip_with_shifted_data_is_the_cause() {
    for alignment in [Alignment::Packed, Alignment::Spaced] {
        for chip in 0..CHIPS {
            let (statuses, _, _) = next_frames(alignment, chip, Fault::ShiftedBit, 2);
            for status in statuses {
                assert_eq!(first_fault(&status), Some((chip, ChipFault::Late(1))));
                assert_eq!(status.bad, (0xFF_u8 >> chip) << chip);
            }
        }
    }
}

#[test]
fn a_doubled_rate_is_detected_at_the_next_edge_and_measured() {
    let (_, edges, meter) = next_frames(Alignment::Spaced, 0, Fault::DoubleRate, 3);
    // The fault came during a conversion at the old rate, so the first edge is on time.
    assert_eq!(edges[1..], [Edge::Early; 2]);
    let error = meter.check().expect_err("too fast");
    assert!(
        matches!(
            error,
            RateError::Off {
                chip: 0,
                early: 2,
                ..
            }
        ),
        "{error:?}"
    );
}

#[test]
fn a_chip_that_starts_at_twice_the_rate_is_named_with_the_factor() {
    let mut bench = Bench::<2, { frame_bytes(2) }>::new(
        Options::default(),
        Electrodes::silent(),
        Settings::EEG,
    );
    bench.simulation.inject(0, Fault::DoubleRate);
    bench.start().unwrap();
    let mut meter = ReadyMeter::new(0, Clock::EEG, Rate::Div4096);
    assert_eq!(meter.check(), Err(RateError::NotMeasured { chip: 0 }));
    for _ in 0..64 {
        meter.edge(bench.edge_us());
    }
    let text = meter.check().expect_err("twice as fast").to_string();
    // 63 periods of 1024 Hz, rounded to whole microseconds, measure as 1023.990 or 1024.007 Hz. The
    // test compares the digits that both have in common.
    let begin = "DRDY of ADS1299 0 comes at 102";
    let end = " Hz, and 512.000 Hz is set, 2 times as fast: ";
    assert!(text.starts_with(begin) && text.contains(end), "{text}");
}

#[test]
fn a_wrong_clock_is_measured() {
    let options = Options {
        clock_hz: 2_048_000,
        ..Options::default()
    };
    let mut bench = Bench::<1, { frame_bytes(1) }>::silent(options);
    let mut meter = ReadyMeter::new(0, Clock::EEG, Rate::Div4096);
    for _ in 0..64 {
        meter.edge(bench.edge_us());
    }
    let text = meter.check().expect_err("500 Hz").to_string();
    assert!(
        text.starts_with("DRDY of ADS1299 0 comes at 500.0"),
        "{text}"
    );
    assert!(text.contains("and 512.000 Hz is set: the clock"), "{text}");
}

#[test]
fn a_missed_drdy_is_counted_at_the_next_edge() {
    let (_, edges, meter) = next_frames(Alignment::Spaced, 0, Fault::MissedReady, 2);
    assert_eq!(edges, [Edge::Missed(1), Edge::OnTime]);
    assert_eq!(meter.missed(), 1);
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
    // The burst takes 108 us and starts 50 us before the end of the next conversion.
    bench.simulation.pass_us(1953 - 50);
    let reading = finish(bench.sampler.read(edge_us)).unwrap();
    let status = reading.status.unwrap();
    assert!(!status.is_sound());
    assert!(status.bad & 0x80 != 0, "{:08b}", status.bad);
}
