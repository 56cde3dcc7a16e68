//! What a device found out about its converters, judged and in words.

use ads1299::Register;
use link::{ChannelFault, ChannelTest, ChipTest, Hello, ResetCause, SelfTest};
use serde::Serialize;

use crate::device::channel_label;

/// The part's bits of an ID register: bit 4 is 1, DEV_ID 11, NU_CH 00, 01 or 10 for 4, 6 or 8
/// channels; above them the revision (data sheet SBAS499, 9.6.1.1).
const PART: u8 = 0x1F;

/// What a device found out about its converters, judged and in words.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SelfTestReport {
    /// Who was tested.
    pub device: DeviceLine,
    /// The first thing that is wrong, in the device's words; empty where all is well.
    pub fault: String,
    /// The edges of DRDY.
    pub ready: ReadyReport,
    /// The chips, the first being the one at MISO.
    pub chips: Vec<ChipReport>,
    /// Their channels, in the order of the ADC's.
    pub channels: Vec<ChannelReport>,
    /// Whether everything is in order.
    pub passed: bool,
    /// The last line.
    pub verdict: String,
}

/// Who a device is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DeviceLine {
    /// Board.
    pub board: String,
    /// Version of the firmware.
    pub firmware: String,
    /// Unique id of its microcontroller, hexadecimal.
    pub uid: String,
    /// Why it started.
    pub reset_cause: String,
    /// What is wrong with its start, or left by a last run that failed; else empty.
    pub fault: String,
}

/// The edges of DRDY, which time everything.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadyReport {
    /// Rate on the device's clock, Hz; none where it was not measured.
    pub rate_hz: Option<f64>,
    /// Rate that was set, Hz.
    pub expected_hz: f64,
    /// How far the one is off the other, parts per million.
    pub ppm: Option<f64>,
    /// Edges that came too early.
    pub early: u32,
    /// Edges that are missing.
    pub missed: u32,
}

/// One chip.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ChipReport {
    /// Its place in the chain, from 0.
    pub chip: usize,
    /// What its ID register says.
    pub id: u8,
    /// The same in words.
    pub part: String,
    /// Registers that did not keep what was written.
    pub registers_wrong: u8,
    /// The first of them; none where there is none.
    pub first_wrong: Option<String>,
    /// Frames that were not to be trusted.
    pub frames_bad: u32,
    /// Whether ID and registers are right.
    pub in_order: bool,
}

/// One channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelReport {
    /// Its number, from 1.
    pub channel: usize,
    /// Its electrode, or exg1, exg2.. of a spare one.
    pub label: String,
    /// Amplitude of the chip's square wave off what was set, percent; this and the figures below are
    /// none where they were not measured.
    pub gain_error_percent: Option<f64>,
    /// Middle of the square wave, microvolt.
    pub offset_uv: Option<f32>,
    /// Around the square wave's levels, microvolt RMS.
    pub noise_uv: Option<f32>,
    /// With the input shorted, microvolt RMS.
    pub shorted_noise_uv: Option<f32>,
    /// What is wrong with it, "not measured", or "in order".
    pub verdict: String,
    /// Whether it was measured and nothing is wrong.
    pub in_order: bool,
}

impl SelfTestReport {
    /// The report of a device that has `channels` ADC channels, the first ones at electrodes of these
    /// labels.
    pub(crate) fn new(
        device: DeviceLine,
        test: &SelfTest,
        channels: usize,
        labels: &[String],
    ) -> SelfTestReport {
        let chips: Vec<ChipReport> = test.chips.iter().enumerate().map(chip).collect();
        let tests = test.channels.iter().enumerate();
        let tested: Vec<ChannelReport> = tests
            .map(|(index, test)| channel(index, test, channel_label(labels, index)))
            .collect();
        let bad =
            |count: usize, of: usize, what| (count > 0).then(|| format!("{count} of {of} {what}"));
        let bad_chips = chips.iter().filter(|chip| !chip.in_order).count();
        let measured = test.channels.iter().filter(|test| !is_unmeasured(test));
        let measured = measured.count();
        let bad_channels = test.channels.iter();
        let bad_channels = bad_channels.filter(|test| test.fault != ChannelFault::None);
        let bad_channels = bad_channels.count();
        let untested = channels.max(tested.len()) - measured;
        let faults: Vec<String> = [
            (!test.fault.is_empty()).then(|| test.fault.as_str().to_owned()),
            bad(bad_chips, chips.len(), "chips"),
            bad(bad_channels, tested.len(), "channels"),
            bad(
                untested,
                channels.max(tested.len()),
                "channels not measured",
            ),
        ]
        .into_iter()
        .flatten()
        .collect();
        let passed = faults.is_empty();
        let verdict = if passed {
            format!(
                "all in order: {} chips, {} channels",
                chips.len(),
                tested.len()
            )
        } else {
            format!("NOT IN ORDER: {}", faults.join("; "))
        };
        SelfTestReport {
            device,
            fault: test.fault.as_str().to_owned(),
            ready: ReadyReport::new(test),
            chips,
            channels: tested,
            passed,
            verdict,
        }
    }
}

impl DeviceLine {
    pub(crate) fn new(hello: &Hello) -> DeviceLine {
        let uid: Vec<String> = hello
            .chip_uid
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        DeviceLine {
            board: hello.board.to_owned(),
            firmware: hello.firmware.to_owned(),
            uid: uid.concat(),
            reset_cause: reset_cause(hello.reset_cause),
            fault: hello.fault.to_owned(),
        }
    }
}

impl ReadyReport {
    fn new(test: &SelfTest) -> ReadyReport {
        let hz = |mhz: u32| f64::from(mhz) / 1000.0;
        let expected_hz = hz(test.expected_millihertz);
        let rate_hz = (test.drdy_millihertz > 0).then(|| hz(test.drdy_millihertz));
        let known = rate_hz.filter(|_| test.expected_millihertz > 0);
        ReadyReport {
            rate_hz,
            expected_hz,
            ppm: known.map(|rate_hz| (rate_hz / expected_hz - 1.0) * 1e6),
            early: test.drdy_early,
            missed: test.drdy_missed,
        }
    }
}

fn chip((chip, test): (usize, &ChipTest)) -> ChipReport {
    let ChipTest {
        id,
        registers_wrong,
        first_wrong,
        frames_bad,
    } = *test;
    let name = || match Register::at(first_wrong) {
        Some(register) => format!("{register} (0x{first_wrong:02X})"),
        None => format!("0x{first_wrong:02X}"),
    };
    ChipReport {
        chip,
        id,
        part: part(id).to_owned(),
        registers_wrong,
        first_wrong: (registers_wrong > 0).then(name),
        frames_bad,
        in_order: id & PART == ads1299::ID & PART && registers_wrong == 0,
    }
}

/// An ID register in words.
fn part(id: u8) -> &'static str {
    match (id, id & PART) {
        (0x00 | 0xFF, _) => "no answer",
        (_, 0x1E) => "ADS1299, 8 channels",
        (_, 0x1D) => "ADS1299-6, 6 channels",
        (_, 0x1C) => "ADS1299-4, 4 channels",
        _ => "not an ADS1299",
    }
}

/// Whether a channel has no fault only because it was not measured, in whole or in part: the test
/// could not go on. A channel that is measured is never without noise and without a fault.
fn is_unmeasured(test: &ChannelTest) -> bool {
    let silent = test.noise_uv == 0.0 || test.shorted_noise_uv == 0.0;
    test.fault == ChannelFault::None && silent
}

fn channel(index: usize, test: &ChannelTest, label: String) -> ChannelReport {
    let too_few = test.fault == ChannelFault::Samples;
    // Without samples the device says 0, and -1 of the gain. With a few, the square wave's levels
    // were not both seen: then it says -1 of the gain as well.
    let nothing = test.offset_uv == 0.0 && test.noise_uv == 0.0;
    let square_wave = !(nothing || too_few && test.gain_error <= -1.0);
    let nothing = test.shorted_noise_uv == 0.0;
    let shorted = !(nothing && (too_few || !square_wave || is_unmeasured(test)));
    ChannelReport {
        channel: index + 1,
        label,
        gain_error_percent: square_wave.then(|| f64::from(test.gain_error) * 100.0),
        offset_uv: square_wave.then_some(test.offset_uv),
        noise_uv: square_wave.then_some(test.noise_uv),
        shorted_noise_uv: shorted.then_some(test.shorted_noise_uv),
        verdict: match test.fault {
            ChannelFault::None if is_unmeasured(test) => "not measured".to_owned(),
            ChannelFault::None => "in order".to_owned(),
            ChannelFault::Samples => "too few samples".to_owned(),
            ChannelFault::Gain => "wrong gain".to_owned(),
            ChannelFault::Offset => "wrong offset".to_owned(),
            ChannelFault::Noisy => "too loud".to_owned(),
            ChannelFault::Silent => "too quiet to be alive".to_owned(),
            ChannelFault::Newer(number) => format!("fault {number}, newer than this bridge"),
        },
        in_order: test.fault == ChannelFault::None && !is_unmeasured(test),
    }
}

fn reset_cause(cause: ResetCause) -> String {
    match cause {
        ResetCause::NotKnown => "a cause that it cannot tell".to_owned(),
        ResetCause::PowerOn => "power on".to_owned(),
        ResetCause::Pin => "the reset pin".to_owned(),
        ResetCause::BrownOut => "a sagging supply".to_owned(),
        ResetCause::Watchdog => "its watchdog".to_owned(),
        ResetCause::Software => "a command".to_owned(),
        ResetCause::Fault => "a fault".to_owned(),
        ResetCause::Newer(number) => format!("cause {number}, newer than this bridge"),
    }
}
