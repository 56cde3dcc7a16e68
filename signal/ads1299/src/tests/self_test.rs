//! The chips' square wave and shorted inputs, streamed by the driver and measured by
//! `SquareWaveTest` and `ShortedTest`.

use std::string::ToString;

use super::Bench;
use crate::channel_tests::{ShortedTest, SquareWaveTest};
use crate::clock::Clock;
use crate::decoder::{CHANNELS, frame_bytes};
use crate::limits::{SelfTestFault, typical_noise_uv};
use crate::settings::{Gain, Input, Rate, Settings};
use crate::simulation::{Electrodes, Options};

const CHIPS: usize = 2;

/// Streams samples with these settings, and passes each channel and its count to `judge`.
fn stream(settings: Settings, samples: u32, mut judge: impl FnMut(usize, i32)) {
    let options = Options { clock_hz: settings.clock.hz(), ..Options::default() };
    let mut bench =
        Bench::<CHIPS, { frame_bytes(CHIPS) }>::new(options, Electrodes::silent(), settings);
    bench.start().unwrap();
    for _ in 0..samples {
        assert!(bench.next().status.unwrap().is_sound());
        let counts = bench.sampler.decoded.as_flattened();
        for (channel, count) in counts.iter().enumerate() {
            judge(channel, *count);
        }
    }
}

fn at(gain: Gain, rate: Rate, input: Input) -> Settings {
    Settings { input, ..Settings::eeg(Clock::EEG, rate, gain) }
}

#[test]
fn the_test_signal_is_measured_within_one_percent_at_every_gain() {
    for gain in Gain::ALL {
        for rate in [Rate::Div4096, Rate::Div8192] {
            let settings = at(gain, rate, Input::TestSignal);
            let mut tests = std::vec![SquareWaveTest::new(gain); CHIPS * CHANNELS];
            stream(settings, 1300, |channel, count| {
                tests[channel].add_sample(count);
            });
            for test in &tests {
                let result = test.result();
                // At gain 1 the noise, averaged over 500 samples, is 3e-5 of the amplitude.
                assert!(result.gain_error.abs() < 1e-4, "{gain:?} {rate:?} {result:?}");
                let typical = typical_noise_uv(gain, rate);
                assert!((result.noise_uv / typical - 1.0).abs() < 0.1, "{result:?}");
                assert_eq!(result.check(gain, rate), Ok(()));
                assert!(result.samples > 1200, "{result:?}");
            }
        }
    }
}

#[test]
fn shorted_inputs_have_the_data_sheets_noise() {
    for rate in Rate::ALL {
        let mut test = ShortedTest::new(Gain::X24);
        let settings = at(Gain::X24, rate, Input::Shorted);
        stream(settings, 500, |_, count| test.add_sample(count));
        let result = test.result();
        let typical = typical_noise_uv(Gain::X24, rate);
        assert!((result.noise_uv / typical - 1.0).abs() < 0.05, "{rate:?} {result:?}");
        assert!(result.offset_uv.abs() < typical, "{result:?}");
        assert_eq!(result.check(Gain::X24, rate), Ok(()));
    }
}

/// Returns a square wave with 100 samples per level and transitions of three samples. The noise
/// alternates between +`noise` and -`noise`.
fn wave(level: i32, offset: i32, noise: i32) -> impl Iterator<Item = i32> {
    (0..1000).map(move |n| {
        let (place, up) = (n % 100, n / 100 % 2 == 0);
        let part = [-4, 0, 4].get(place).copied().unwrap_or(6);
        let ideal = offset + level * part / 6 * if up { 1 } else { -1 };
        ideal + if n % 2 == 0 { noise } else { -noise }
    })
}

fn judged(level: i32, offset: i32, noise: i32) -> Result<(), SelfTestFault> {
    let mut test = SquareWaveTest::new(Gain::X24);
    wave(level, offset, noise).for_each(|count| test.add_sample(count));
    test.result().check(Gain::X24, Rate::Div4096)
}

#[test]
fn each_limit_can_be_exceeded_and_is_named() {
    // At gain 24, 1.875 mV is 83,886 counts, and 0.2 uV is 9 counts. The limits are 3 % of gain,
    // 300 uV of offset (13,422 counts), and 0.10 to 0.42 uV of noise (4.7 to 18.8 counts).
    assert_eq!(judged(83_886, 0, 9), Ok(()));
    assert_eq!(judged(83_886, 5000, 9), Ok(()));
    let low = judged(80_000, 0, 9).expect_err("4.6 % too low").to_string();
    assert!(low.starts_with("gain off by -4.63 %, 3.0 % allowed"), "{low}");
    let offset = judged(83_886, -20_000, 9).expect_err("447 uV");
    assert!(
        matches!(offset, SelfTestFault::Offset { measured, .. } if (measured + 447.0).abs() < 1.0)
    );
    let noisy = judged(83_886, 0, 40).expect_err("0.9 uV");
    assert!(matches!(noisy, SelfTestFault::Noisy { .. }), "{noisy}");
    let silent = judged(83_886, 0, 0).expect_err("nothing at all");
    assert!(matches!(silent, SelfTestFault::Silent { .. }), "{silent}");
    let dead = judged(0, 0, 0).expect_err("no square wave");
    assert!(matches!(dead, SelfTestFault::Gain { measured, .. } if measured <= -1.0), "{dead}");
}

#[test]
fn long_streams_at_the_rails_do_not_overflow() {
    let mut test = SquareWaveTest::new(Gain::X1);
    let mut shorted = ShortedTest::new(Gain::X1);
    for n in 0..300_000 {
        let count = if n / 1000 % 2 == 0 { (1 << 23) - 1 } else { -(1 << 23) };
        test.add_sample(count);
        shorted.add_sample(count);
    }
    assert!(test.result().gain_error > 1000.0);
    assert!(shorted.result().noise_uv > 1e6);
    assert_eq!(shorted.result().samples, 1 << 16);
}
