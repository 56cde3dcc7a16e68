//! Samples streamed by the driver, with and without don't-care bits between the chips.

use std::vec::Vec;

use crate::alignment::Alignment;
use crate::clock::Clock;
use crate::decoder::Decoder;
use crate::frame::CHANNELS;
use crate::frame::frame_bytes;
use crate::gain::Gain;
use crate::lead_off::{LeadOff, LeadOffThreshold};
use crate::rate::Rate;
use crate::ready::{Edge, ReadyMeter};
use crate::settings::Settings;
use crate::simulation::{Electrodes, Options, Simulation, finish};

/// Fills in counts that differ between channels and samples.
fn unlike<const CHIPS: usize>(sample: u64, counts: &mut [[i32; CHANNELS]; CHIPS]) {
    for (chip, counts) in counts.iter_mut().enumerate() {
        for (channel, count) in counts.iter_mut().enumerate() {
            let mixed = sample * 8191 + (chip * 64 + channel) as u64 * 131_071;
            *count = (mixed % (1 << 24)) as i32 - (1 << 23);
        }
    }
}

#[test]
fn every_sample_arrives_once_and_unchanged_on_either_kind_of_board() {
    for alignment in [Alignment::Packed, Alignment::Spaced] {
        let options = Options {
            alignment,
            ..Options::default()
        };
        let simulation = Simulation::<8>::new(options, Electrodes::counts(unlike));
        let (mut chain, mut drdy) = (simulation.chain(), simulation.drdy());
        let mut configured = finish(chain.power_up(&Settings::EEG)).unwrap().unwrap();
        let mut streaming = finish(configured.start()).unwrap().unwrap();
        let mut decoder = Decoder::<8>::new();
        let mut meter = ReadyMeter::new(0, Clock::EEG, Rate::Div4096);
        let mut frame = [0; frame_bytes(8)];
        for sample in 0..1000 {
            finish(streaming.ready(&mut drdy)).unwrap().unwrap();
            assert!(matches!(
                meter.edge(simulation.time_us()),
                Edge::First | Edge::OnTime
            ));
            finish(streaming.read(&mut frame)).unwrap().unwrap();
            let (mut counts, mut expected) = ([[0; CHANNELS]; 8], [[0; CHANNELS]; 8]);
            unlike(sample, &mut expected);
            let status = decoder.decode(&frame, &mut counts);
            assert!(status.is_sound(), "{status:?}");
            assert_eq!(counts, expected, "sample {sample}");
        }
        assert_eq!(decoder.alignment(), Some(alignment));
        // Two stamps of 1 us resolution over 1.95 s are 1 ppm, or 0.5 mHz of 512 Hz.
        assert!(meter.check().unwrap().abs_diff(512_000) <= 1);
        finish(streaming.stop()).unwrap().unwrap();
        assert_eq!(simulation.violations(), 0);
    }
}

#[test]
fn every_rate_and_gain_takes_effect() {
    for rate in Rate::ALL {
        for (clock, gain) in Gain::ALL.iter().map(|gain| (Clock::EEG, *gain)) {
            let options = Options {
                burst_hz: 20_000_000,
                ..Options::default()
            };
            // 10 mV is below the rail at every gain, and far above the noise.
            let electrodes = Electrodes::volts(|_, volts| *volts = [[0.01; CHANNELS]]);
            let simulation = Simulation::<1>::new(options, electrodes);
            let mut settings = Settings::<1>::EEG;
            settings.clock = clock;
            settings.rate = rate;
            settings.chips[0]
                .channels
                .iter_mut()
                .for_each(|channel| channel.gain = gain);
            let (mut chain, mut drdy) = (simulation.chain(), simulation.drdy());
            let mut configured = finish(chain.power_up(&settings)).unwrap().unwrap();
            let start_us = simulation.time_us();
            let mut streaming = finish(configured.start()).unwrap().unwrap();
            let mut meter = ReadyMeter::new(0, clock, rate);
            let mut decoder = Decoder::<1>::new();
            let (mut frame, mut counts) = ([0; frame_bytes(1)], [[0; CHANNELS]]);
            for n in 0..100 {
                finish(streaming.ready(&mut drdy)).unwrap().unwrap();
                let time_us = simulation.time_us();
                if n == 0 {
                    let settled = u64::from(clock.microseconds(rate.settling()));
                    assert!((time_us - start_us).abs_diff(settled) <= 2, "{rate:?}");
                }
                meter.edge(time_us);
                finish(streaming.read(&mut frame)).unwrap().unwrap();
                assert!(decoder.decode(&frame, &mut counts).is_sound());
                for count in counts[0] {
                    let uv = f64::from(count) * gain.lsb_uv();
                    assert!((uv - 10_000.0).abs() < 150.0, "{rate:?} {gain:?}: {uv}");
                }
            }
            meter.check().unwrap();
        }
    }
}

#[test]
fn a_disconnected_electrode_sets_its_bit_and_reads_the_rail() {
    let simulation = Simulation::<8>::new(Options::default(), Electrodes::counts(unlike));
    let mut settings = Settings::EEG;
    settings.lead_off = LeadOff {
        comparators: true,
        threshold: LeadOffThreshold::P95,
        ..LeadOff::OFF
    };
    settings.chips[4].lead_off_positive = 0xFF;
    settings.chips[4].lead_off_negative = 0x0F;
    settings.chips[4].lead_off_flip = 0x02;
    let (mut chain, mut drdy) = (simulation.chain(), simulation.drdy());
    let mut configured = finish(chain.power_up(&settings)).unwrap().unwrap();
    let mut streaming = finish(configured.start()).unwrap().unwrap();
    simulation.set_electrode(4, 5, true, false);
    simulation.set_electrode(4, 1, false, false);
    // These two electrodes have no lead-off current, so they are not detected.
    simulation.set_electrode(4, 7, false, false);
    simulation.set_electrode(2, 0, true, false);
    let (mut frame, mut counts) = ([0; frame_bytes(8)], [[0; CHANNELS]; 8]);
    let mut decoder = Decoder::<8>::new();
    finish(streaming.ready(&mut drdy)).unwrap().unwrap();
    finish(streaming.read(&mut frame)).unwrap().unwrap();
    let status = decoder.decode(&frame, &mut counts);
    let off: Vec<_> = status
        .words
        .map(|word| (word.off_positive(), word.off_negative()))
        .into();
    let mut expected = [(0, 0); 8];
    expected[4] = (0x20, 0x02);
    assert_eq!(off, expected);
    assert_eq!((counts[4][5], counts[4][1]), ((1 << 23) - 1, -(1 << 23)));
    simulation.set_electrode(4, 5, true, true);
    simulation.set_electrode(4, 1, false, true);
    finish(streaming.ready(&mut drdy)).unwrap().unwrap();
    finish(streaming.read(&mut frame)).unwrap().unwrap();
    let status = decoder.decode(&frame, &mut counts);
    assert!(
        status
            .words
            .iter()
            .all(|word| word.off_positive() | word.off_negative() == 0)
    );
}
