//! Impedance of electrodes while samples stream: known impedances, and switching the excitation.
#![expect(clippy::cast_precision_loss, reason = "few samples")]

use std::f64::consts::{PI, TAU};
use std::vec::Vec;
use std::{boxed::Box, print, println};

use super::{Bench, run};
use crate::bus::Drdy as _;
use crate::decoder::{CHANNELS, frame_bytes};
use crate::impedance::{FUNDAMENTAL, ImpedanceMeter};
use crate::register::Register;
use crate::retrying_sampler::RetryingSampler;
use crate::sampler::Sampler;
use crate::settings::{Gain, Rate, Settings, Wiring};
use crate::simulation::{Deliver, Electrodes, Fault, Options, Simulation, finish};

const OHMS: [f64; CHANNELS] =
    [1_000.0, 2_000.0, 5_000.0, 10_000.0, 20_000.0, 50_000.0, 100_000.0, 500_000.0];

/// Number of channels of one chip.
const ALL: u8 = 8;

type Meter = ImpedanceMeter<CHANNELS>;

/// Returns the amplitude of the fundamental in the samples of a square wave of 1 and -1, whose
/// period is four samples and which changes `phase` sample periods after a sample. Computed without
/// the driver's formulas: a sinc filter of third order is three moving averages over one period.
fn sampled_amplitude(phase: f64) -> f64 {
    const FINE: usize = 256;
    let square = |n: usize| {
        let t = (n as f64 + 0.5) / FINE as f64 - phase;
        if t.rem_euclid(4.0) < 2.0 { 1.0 } else { -1.0 }
    };
    let mut signal: Vec<f64> = (0..16 * FINE).map(square).collect();
    for _ in 0..3 {
        signal =
            signal.windows(FINE).map(|window| window.iter().sum::<f64>() / FINE as f64).collect();
    }
    let x: Vec<f64> = signal.into_iter().step_by(FINE).take(4).collect();
    f64::hypot((x[0] - x[2]) / 2.0, (x[1] - x[3]) / 2.0)
}

#[test]
fn the_fundamental_of_the_sampled_square_wave_is_within_one_and_a_half_percent_at_any_phase() {
    // Closed form: harmonic k has the amplitude 4 / (pi k), the filter's gain at this harmonic is
    // (sin(pi k / 4) / (pi k / 4))^3, and the fundamental is k = 1.
    let harmonic = |k: f64| 4.0 / (PI * k) * ((PI * k / 4.0).sin() / (PI * k / 4.0)).powi(3);
    assert!((harmonic(1.0) / FUNDAMENTAL - 1.0).abs() < 1e-12);
    let amplitudes: Vec<f64> =
        (0..64).map(|n| sampled_amplitude(f64::from(n) / 16.0) / FUNDAMENTAL).collect();
    let mean = amplitudes.iter().sum::<f64>() / amplitudes.len() as f64;
    let [least, most] = [f64::min, f64::max].map(|of| amplitudes.iter().copied().reduce(of));
    // Measured ratios to `FUNDAMENTAL`: 0.9866 to 1.0147, mean 1.00004.
    println!("{least:?} to {most:?}, mean {mean}");
    assert!((mean - 1.0).abs() < 0.001, "{mean}");
    assert!(least.is_some_and(|x| x > 0.985) && most.is_some_and(|x| x < 1.015));
}

/// Returns an EEG-like source: in each channel, noise of 20 uV RMS that falls by 12 dB per octave,
/// alpha waves of 10 uV, and mains of 5 uV RMS with two harmonics.
fn eeg(rate_hz: f64) -> Deliver<f64, 1> {
    let mut state = [[0.0_f64; 2]; CHANNELS];
    let mut seed = 1_u32;
    // Two poles `a` at 3 Hz shape the noise. They turn white noise of variance 1/12 into noise of
    // variance (1 - a)^4 (1 + a^2) / (1 - a^2)^3 / 12.
    let pole = (-TAU * 3.0 / rate_hz).exp();
    let square = pole * pole;
    let variance = (1.0 - pole).powi(4) * (1.0 + square) / (1.0 - square).powi(3) / 12.0;
    let gain = 20.0 / variance.sqrt();
    Box::new(move |sample, volts| {
        let t = sample as f64 / rate_hz;
        let mains = |harmonic: f64, uv: f64| uv * (TAU * 50.03 * harmonic * t).sin();
        let interference = mains(1.0, 7.07) + mains(2.0, 1.0) + mains(3.0, 1.0);
        let alpha = 10.0 * (TAU * 10.2 * t).sin();
        for ([first, second], volts) in state.iter_mut().zip(&mut volts[0]) {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let white = f64::from(seed) / f64::from(u32::MAX) - 0.5;
            *first = pole * *first + (1.0 - pole) * white;
            *second = pole * *second + (1.0 - pole) * *first;
            *volts = (gain * *second + alpha + interference) * 1e-6;
        }
    })
}

/// Returns a running chip with a sample rate of `hz` and electrode impedances of [`OHMS`], and a
/// meter for its samples. The excitation is on. The conversions start `delay_us` later, which moves
/// the phase of the excitation.
fn excited(
    hz: u32,
    gain: Gain,
    delay_us: u64,
    deliver: Deliver<f64, 1>,
) -> (Bench<1, { frame_bytes(1) }>, Meter) {
    let (clock, rate) = Rate::of_hz(hz).expect("a rate");
    let settings = Settings::eeg(clock, rate, gain);
    let options = Options { clock_hz: clock.hz(), ..Options::default() };
    let mut bench = Bench::new(options, Electrodes::Volts(deliver), settings);
    for (channel, ohms) in OHMS.into_iter().enumerate() {
        bench.simulation.set_impedance(0, channel, ohms);
    }
    bench.simulation.pass_us(delay_us);
    bench.start().unwrap();
    bench.next();
    run(bench.sampler.set_excitation(ALL));
    (bench, Meter::new(settings))
}

/// Reads samples until a measurement is complete, and returns its impedances in ohms.
fn measure(bench: &mut Bench<1, { frame_bytes(1) }>, meter: &mut Meter) -> [u32; CHANNELS] {
    loop {
        let reading = bench.next();
        assert!(reading.is_sound() && reading.missed == 0, "{reading:?}");
        if let Some(ohms) = meter.observe(&bench.sampler.counts()[0]) {
            return ohms;
        }
    }
}

#[test]
fn known_impedances_are_measured_within_5_percent_under_eeg_and_mains() {
    for hz in [250, 256, 500, 512, 1000, 1024] {
        print!("{hz:5} Hz:");
        let mut worst = [0.0_f64; CHANNELS];
        for phase in 0..8 {
            let (mut bench, mut meter) = excited(hz, Gain::X24, phase * 977, eeg(f64::from(hz)));
            for _ in 0..3 {
                let found = measure(&mut bench, &mut meter);
                for ((worst, found), ohms) in worst.iter_mut().zip(found).zip(OHMS) {
                    let error = f64::from(found) / ohms - 1.0;
                    *worst = if error.abs() > worst.abs() { error } else { *worst };
                }
            }
        }
        for (ohms, worst) in OHMS.iter().zip(worst) {
            print!(" {:.0} kOhm {:+.2} %;", ohms / 1000.0, 100.0 * worst);
            assert!(worst.abs() < 0.05, "{ohms} at {hz} Hz: {worst}");
        }
        println!();
    }
}

#[test]
fn the_gain_does_not_change_an_impedance_and_an_electrode_without_any_reads_near_zero() {
    for gain in Gain::ALL {
        let (mut bench, mut meter) = excited(512, gain, 0, Box::new(|_, _| ()));
        bench.simulation.set_impedance(0, 0, 0.0);
        let found = measure(&mut bench, &mut meter);
        // The limit covers the noise, which at gain 1 is some 7 times as large as at gain 24.
        assert!(found[0] < 100, "{gain:?}: {found:?}");
        assert!(found[4].abs_diff(20_000) < 500, "{gain:?}: {found:?}");
    }
}

#[test]
fn a_disconnected_electrode_and_one_at_the_rail_are_open() {
    let at_rail: Deliver<f64, 1> = Box::new(|_, volts| volts[0][3] = 1.0);
    let (mut bench, mut meter) = excited(512, Gain::X24, 0, at_rail);
    bench.simulation.set_electrode(0, 6, false);
    bench.simulation.set_impedance(0, 7, 2e6);
    let found = measure(&mut bench, &mut meter);
    let open: [bool; CHANNELS] = found.map(|ohms| ohms == Meter::OPEN);
    let expected = core::array::from_fn(|channel| [3, 6, 7].contains(&channel));
    assert_eq!(open, expected, "{found:?}");
}

#[test]
fn a_restart_measures_whole_seconds_again() {
    let (mut bench, mut meter) = excited(512, Gain::X24, 0, Box::new(|_, _| ()));
    for _ in 0..700 {
        bench.next();
        meter.observe(&bench.sampler.counts()[0]);
    }
    meter.restart();
    let mut samples = 0;
    let found = loop {
        bench.next();
        samples += 1;
        if let Some(found) = meter.observe(&bench.sampler.counts()[0]) {
            break found;
        }
    };
    assert_eq!((samples, meter.samples()), (512 + 8, 512));
    assert!(found[2].abs_diff(5_000) < 100, "{found:?}");
}

#[test]
fn the_excitation_is_switched_between_two_samples_without_losing_one() {
    for (wiring, channels) in [
        (Wiring::Cascaded, 61),
        // Six of the chips have fewer than eight electrodes, so their values of LOFF_SENSP must be
        // written one by one.
        (Wiring::Daisy, 17),
        (Wiring::Daisy, 61),
    ] {
        switch_and_lose_none(wiring, channels);
    }
}

fn switch_and_lose_none(wiring: Wiring, channels: u8) {
    const CHIPS: usize = 8;
    let counts = |sample: u64, counts: &mut [[i32; CHANNELS]; CHIPS]| {
        *counts = [[i32::try_from(sample).unwrap(); CHANNELS]; CHIPS];
    };
    let options = Options { wiring, ..Options::default() };
    let settings = Settings { wiring, ..Settings::EEG };
    let simulation = Simulation::<CHIPS>::new(options, Electrodes::counts(counts));
    for chip in 0..CHIPS {
        simulation.set_impedance(chip, 2, 20_000.0);
    }
    let sampler =
        Sampler::<_, _, _, CHIPS, { frame_bytes(CHIPS) }>::new(simulation.chain(), settings);
    let mut chain = RetryingSampler::new(sampler, 5_000_000);
    let mut drdy = simulation.drdy();
    finish(chain.start(true, &mut drdy)).unwrap();
    for sample in 0..400 {
        let wanted = if (100..300).contains(&sample) { channels } else { 0 };
        let before_us = drdy.now_us();
        finish(chain.switch_excitation(wanted, &mut drdy)).unwrap();
        let took_us = drdy.now_us() - before_us;
        assert!(took_us < 1_000, "{took_us}");
        assert_eq!(chain.sampler().settings().excited, wanted);
        let (reading, _) = finish(chain.next(&mut drdy)).unwrap();
        assert!(reading.is_sound() && reading.missed == 0, "{sample}: {reading:?}");
        let counts = chain.sampler().counts();
        assert_eq!([counts[0][0], counts[7][7]], [sample; 2]);
        let is_excited = [0, 7].map(|chip| (counts[chip][2] - sample).abs() > 100);
        let expected = [wanted > 2, wanted > 58];
        assert_eq!(is_excited, expected, "{sample}: {counts:?}");
    }
    assert_eq!(simulation.violations(), 0);
    // After a loss of supply, the registers are written again, with the excitation.
    finish(chain.switch_excitation(channels, &mut drdy)).unwrap();
    simulation.power_off();
    for _ in 0..10 {
        finish(chain.next(&mut drdy)).unwrap();
    }
    simulation.power_on();
    while drdy.now_us() < 20_000_000 {
        finish(chain.switch_excitation(channels, &mut drdy)).unwrap();
        finish(chain.next(&mut drdy)).unwrap();
    }
    assert_eq!(chain.failure(), None);
    let counts = chain.sampler().counts()[0];
    assert!((counts[2] - counts[0]).abs() > 100, "{counts:?}");
}

#[test]
fn a_chip_that_ignores_the_command_shows_electrodes_without_impedance() {
    let mut bench = Bench::<2, { frame_bytes(2) }>::silent(Options::default());
    for chip in 0..2 {
        bench.simulation.set_impedance(chip, 1, 5_000.0);
    }
    bench.simulation.inject(1, Fault::Forgets(Register::LOFF_SENSP));
    run(bench.sampler.set_excitation(16));
    let mut meter = ImpedanceMeter::<16>::new(Settings::EEG);
    let found = loop {
        bench.next();
        if let Some(found) = meter.observe(bench.sampler.counts().as_flattened()) {
            break found;
        }
    };
    assert!(found[1] > 4_800 && found[9] < 50, "{found:?}");
}
