//! Samples streamed by the driver, with and without don't-care bits between the chips.

use super::{Bench, run};
use crate::clock::Clock;
use crate::decoder::{Alignment, CHANNELS, frame_bytes};
use crate::ready::{Edge, ReadyMeter};
use crate::settings::{Gain, Rate, Settings};
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
        let options = Options { alignment, ..Options::default() };
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
        // The 1 us resolution of both stamps causes an error of up to 1 ppm over 1.95 s, which is
        // 0.5 mHz at 512 Hz.
        assert!(meter.check().unwrap().abs_diff(512_000) <= 1);
        run(bench.sampler.chain.halt(Settings::EEG));
        assert_eq!(bench.simulation.violations(), 0);
    }
}

#[test]
fn every_rate_and_gain_takes_effect() {
    for rate in Rate::ALL {
        for gain in Gain::ALL {
            let options = Options { burst_hz: 20_000_000, ..Options::default() };
            // 10 mV is below the rail at every gain, and far above the noise.
            let electrodes = Electrodes::volts(|_, volts| *volts = [[0.01; CHANNELS]]);
            let clock = Clock::EEG;
            let settings = Settings::eeg(clock, rate, gain);
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
