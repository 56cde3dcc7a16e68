//! Samples streamed by the driver, with and without don't-care bits between the chips.

use std::vec::Vec;

use super::Bench;
use crate::clock::Clock;
use crate::decoder::{Alignment, CHANNELS, frame_bytes};
use crate::ready::{Edge, ReadyMeter};
use crate::settings::{Gain, LeadOff, LeadOffThreshold, Rate, Settings};
use crate::simulation::{Electrodes, Event, Options, finish};

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
        let mut bench =
            Bench::<8, { frame_bytes(8) }>::new(options, Electrodes::counts(unlike), Settings::EEG);
        bench.start().unwrap();
        let mut meter = ReadyMeter::new(0, Clock::EEG, Rate::Div4096);
        for sample in 0..1000 {
            let edge_us = bench.edge_us();
            assert!(matches!(meter.edge(edge_us), Edge::First | Edge::OnTime));
            let reading = finish(bench.sampler.read(edge_us)).unwrap();
            assert!(reading.is_sound() && reading.missed == 0, "{reading:?}");
            let mut expected = [[0; CHANNELS]; 8];
            unlike(sample, &mut expected);
            assert_eq!(bench.sampler.counts(), &expected, "sample {sample}");
        }
        assert_eq!(bench.sampler.decoder.alignment(), Some(alignment));
        // Two stamps of 1 us resolution over 1.95 s are 1 ppm, or 0.5 mHz of 512 Hz.
        assert!(meter.check().unwrap().abs_diff(512_000) <= 1);
        finish(bench.sampler.chain.halt()).unwrap().unwrap();
        assert_eq!(bench.simulation.violations(), 0);
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
            let mut settings = Settings::<1>::EEG;
            settings.clock = clock;
            settings.rate = rate;
            settings.chips[0]
                .channels
                .iter_mut()
                .for_each(|channel| channel.gain = gain);
            let mut bench = Bench::<1, { frame_bytes(1) }>::new(options, electrodes, settings);
            bench.start().unwrap();
            let events = bench.simulation.events();
            let is_start = |(_, event): &&(u64, Event)| *event == Event::Start(true);
            let start_us = events.iter().rfind(is_start).expect("it converts").0 / 1000;
            let mut meter = ReadyMeter::new(0, clock, rate);
            for n in 0..100 {
                let edge_us = bench.edge_us();
                if n == 0 {
                    let settled = u64::from(clock.microseconds(rate.settling()));
                    assert!((edge_us - start_us).abs_diff(settled) <= 2, "{rate:?}");
                }
                meter.edge(edge_us);
                assert!(finish(bench.sampler.read(edge_us)).unwrap().is_sound());
                for count in bench.sampler.counts()[0] {
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
    let mut settings = Settings::EEG;
    settings.lead_off = LeadOff {
        comparators: true,
        threshold: LeadOffThreshold::P95,
        ..LeadOff::OFF
    };
    settings.chips[4].lead_off_positive = 0xFF;
    settings.chips[4].lead_off_negative = 0x0F;
    settings.chips[4].lead_off_flip = 0x02;
    let electrodes = Electrodes::counts(unlike);
    let mut bench = Bench::<8, { frame_bytes(8) }>::new(Options::default(), electrodes, settings);
    bench.start().unwrap();
    let Bench { simulation, .. } = &bench;
    simulation.set_electrode(4, 5, true, false);
    simulation.set_electrode(4, 1, false, false);
    // These two electrodes have no lead-off current, so they are not detected.
    simulation.set_electrode(4, 7, false, false);
    simulation.set_electrode(2, 0, true, false);
    let status = bench.next().status.unwrap();
    let off: Vec<_> = status
        .words
        .map(|word| (word.off_positive(), word.off_negative()))
        .into();
    let mut expected = [(0, 0); 8];
    expected[4] = (0x20, 0x02);
    assert_eq!(off, expected);
    let counts = bench.sampler.counts()[4];
    assert_eq!((counts[5], counts[1]), ((1 << 23) - 1, -(1 << 23)));
    bench.simulation.set_electrode(4, 5, true, true);
    bench.simulation.set_electrode(4, 1, false, true);
    let status = bench.next().status.unwrap();
    assert!(
        status
            .words
            .iter()
            .all(|word| word.off_positive() | word.off_negative() == 0)
    );
}
