//! The complete self-test, on working and broken chains.

use std::string::ToString;

use super::{Bench, run};
use crate::decoder::{CHANNELS, frame_bytes};
use crate::error::Error;
use crate::image::Image;
use crate::ready::RateError;
use crate::register::{ID, Register};
use crate::self_test::SelfTest;
use crate::self_test_report::{Finding, SelfTestReport};
use crate::settings::Settings;
use crate::simulation::{Electrodes, Fault, Options, finish};

const CHIPS: usize = 3;

type Chain = Bench<CHIPS, { frame_bytes(CHIPS) }>;

/// Runs the self-test of a running chain, with a fault if `broken` names one. The last value
/// returned is the longest time between calls of `progress`, in microseconds.
fn tested(options: Options, broken: Option<(usize, Fault)>) -> (Chain, SelfTestReport<CHIPS>, u64) {
    let mut bench = Chain::silent(options);
    for _ in 0..5 {
        assert!(bench.next().is_sound());
    }
    if let Some((chip, fault)) = broken {
        bench.simulation.inject(chip, fault);
    }
    let mut test = SelfTest::new();
    let simulation = &bench.simulation;
    let (mut alive_us, mut longest_us) = (simulation.time_us(), 0);
    let progress = || {
        longest_us = longest_us.max(simulation.time_us() - alive_us);
        alive_us = simulation.time_us();
    };
    let run = (bench.sampler).self_test(&mut test, &mut bench.drdy, progress);
    finish(run).unwrap();
    let report = test.report().clone();
    (bench, report, longest_us)
}

fn finding(broken: (usize, Fault)) -> (SelfTestReport<CHIPS>, Finding) {
    let (_, report, longest_us) = tested(Options::default(), Some(broken));
    assert!(longest_us < 50_000, "{longest_us}");
    let finding = report.check().expect_err("a fault");
    (report, finding)
}

/// Returns the number of channels of a chip that violate a limit of the self-test.
fn faulty(report: &SelfTestReport<CHIPS>, chip: usize) -> usize {
    let channels = report.channels[chip].iter();
    channels.filter(|channel| channel.fault.is_some()).count()
}

#[test]
fn a_working_chain_passes_with_figures_and_keeps_streaming() {
    let (mut bench, report, longest_us) = tested(Options::default(), None);
    assert_eq!(report.check(), Ok(()));
    assert!(longest_us <= 21_000, "{longest_us}");
    for chip in &report.chips {
        assert_eq!((chip.id, chip.differing, chip.bad_frames), (ID, 0, 0));
    }
    let ready = report.ready;
    assert_eq!((ready.expected, ready.early, ready.missed), (512_000, 0, 0));
    assert!(ready.measured.abs_diff(512_000) <= 1, "{ready:?}");
    for channel in report.channels.as_flattened() {
        // Tolerance: averaged over 1000 samples, the noise is below 1e-5 of the amplitude. The
        // typical noise is 0.21 uV rms.
        assert!(channel.gain_error.abs() < 1e-4 && channel.gain_error != 0.0, "{channel:?}");
        assert!(channel.offset_uv.abs() < 0.1, "{channel:?}");
        assert!((channel.noise_uv - 0.21).abs() < 0.02, "{channel:?}");
        assert!((channel.shorted_noise_uv - 0.21).abs() < 0.02, "{channel:?}");
    }
    assert!(bench.sampler.is_running());
    bench.simulation.pass_us(20_000);
    assert!(bench.next().is_sound());
    assert_eq!(bench.simulation.violations(), 0);
    // The previous settings are restored.
    let mut chain = bench.simulation.chain();
    run(chain.halt(Settings::EEG));
    for chip in 0..CHIPS {
        let mut read = Image([0; Register::COUNT]);
        run(chain.read_part(chip, &mut read, 0..Register::COUNT));
        assert_eq!(read, Settings::EEG.image(chip));
    }
}

#[test]
fn a_dead_chip_is_named_and_those_before_it_are_tested() {
    let (report, finding) = finding((1, Fault::Dead));
    assert_eq!(finding, Finding::Chain(Error::WrongId { chip: 1, read: 0 }));
    assert_eq!((report.chips[0].fault, report.chips[2].fault), (None, None));
    let bad = report.chips.map(|chip| chip.bad_frames);
    assert_eq!(bad, [0, 2040, 2040]);
    assert_eq!(faulty(&report, 0), 0);
    assert_eq!(faulty(&report, 2), CHANNELS);
    assert_eq!(report.ready.fault, None);
    assert_eq!(report.not_restored.and_then(|error| error.chip()), Some(1));
}

#[test]
fn without_drdy_the_test_stops_and_names_chip_0() {
    let (report, finding) = finding((0, Fault::Dead));
    assert_eq!(finding.chip(), Some(0));
    let stopped = report.stopped.expect("no DRDY");
    assert!(matches!(stopped, Error::NeverReady { chip: 0, .. }), "{stopped}");
    let text = stopped.to_string();
    assert!(text.starts_with("ADS1299 0 made no sample in 15630 us after START"), "{text}");
    assert_eq!(report.ready.measured, 0);
    assert_eq!(report.ready.fault, Some(RateError::NotMeasured { chip: 0 }));
}

#[test]
fn a_wrong_id_is_named_and_the_chip_is_still_measured() {
    let (report, finding) = finding((2, Fault::WrongId(0x92)));
    assert_eq!(finding, Finding::Chain(Error::WrongId { chip: 2, read: 0x92 }));
    assert_eq!(report.chips.map(|chip| chip.id), [ID, ID, 0x92]);
    assert_eq!([0, 1, 2].map(|chip| faulty(&report, chip)), [0; CHIPS]);
}

#[test]
fn a_register_that_ignores_writes_is_named_with_its_chip_and_affects_its_channel() {
    let (report, finding) = finding((1, Fault::Forgets(Register::CH1SET)));
    let text = finding.to_string();
    assert!(text.starts_with("CH1SET of ADS1299 1 holds 0x61, and 0x65 was written"), "{text}");
    let differing = report.chips.map(|chip| (chip.differing, chip.first_differing()));
    assert_eq!(differing, [(0, None), (1, Some(Register::CH1SET)), (0, None)]);
    let gain = report.channels[1][0].gain_error;
    assert!(gain < -0.99, "{gain}");
}

#[test]
fn frozen_shifted_and_wrong_frames_are_counted_and_not_measured() {
    for (fault, behind) in
        [(Fault::StuckData, 0), (Fault::ShiftedBit, 2040), (Fault::WrongNibble(9), 0)]
    {
        let (report, finding) = finding((1, fault));
        let Finding::Frames { chip: 1, bad } = finding else {
            panic!("{fault:?}: {finding}");
        };
        // Of the 2040 frames, the first of each of the two measurements has no predecessor to
        // repeat.
        assert!((2038..=2040).contains(&bad), "{fault:?} {bad}");
        assert_eq!(report.chips[2].bad_frames, behind, "{fault:?}");
        assert_eq!(faulty(&report, 0), 0);
        assert_eq!(faulty(&report, 1), CHANNELS);
    }
}

#[test]
fn a_doubled_rate_and_a_missing_edge_are_measured_at_chip_0() {
    let (report, doubled) = finding((0, Fault::DoubleRate));
    assert!(matches!(doubled, Finding::Rate(RateError::Off { chip: 0, .. })), "{doubled}");
    assert!(report.ready.measured.abs_diff(1_024_000) < 20, "{:?}", report.ready);
    // The chip omits only the first edge after START. The first edge that the test sees is then
    // late, which the test cannot detect.
    let (_, report, _) = tested(Options::default(), Some((0, Fault::MissedReady)));
    assert_eq!(report.check(), Ok(()));
    let mut bench = Chain::new(Options::default(), Electrodes::silent(), Settings::EEG);
    let mut test = SelfTest::new();
    let mut signs = 0;
    let progress = || {
        signs += 1;
        if signs == 500 {
            bench.simulation.inject(0, Fault::MissedReady);
        }
    };
    finish(bench.sampler.self_test(&mut test, &mut bench.drdy, progress)).unwrap();
    let report = test.report();
    let missing = report.check().expect_err("a missing edge");
    assert!(matches!(missing, Finding::Rate(RateError::Off { missed: 1, .. })), "{missing}");
    assert_eq!((report.ready.missed, report.ready.early), (1, 0));
}

#[test]
fn it_needs_little_memory_besides_the_callers() {
    let bytes = size_of::<SelfTest<8>>();
    assert!(bytes < 8_192, "{bytes}");
    let mut bench = Bench::<8, { frame_bytes(8) }>::new(
        Options::default(),
        Electrodes::silent(),
        Settings::EEG,
    );
    let mut test = SelfTest::new();
    let future = bench.sampler.self_test(&mut test, &mut bench.drdy, || ());
    let bytes = size_of_val(&future);
    assert!(bytes < 2_048, "{bytes}");
}
