//! Converters of a device: their settings, and the messages about them.

use core::fmt::{self, Write};

use ads1299::{
    CHANNELS, Control, Error, Gain, Rate, Reading, SamplerCounters, SelfTestFault, SelfTestReport,
    Settings, Wiring,
};
use heapless::String;
use link::{ChannelFault, ChannelTest, ChipTest, Converters, MAX_TEXT_BYTES, SelfTest};

use crate::chunk::narrow;

/// Builds the status message of a chain of converters.
///
/// Arguments: the fault found when the chain was initialised, the measured rate of DRDY in
/// millihertz, the newest reading and the driver's counters.
pub fn converters_message<const CHIPS: usize>(
    fault: Option<&Error>,
    drdy_millihertz: Option<u32>,
    newest: Option<&Reading<CHIPS>>,
    counters: &SamplerCounters<CHIPS>,
) -> Converters {
    let off = |side: fn(&Reading<CHIPS>, usize) -> u8| {
        newest.map_or(0, |reading| {
            let chips = (0..CHIPS).rev().map(|chip| side(reading, chip));
            chips.fold(0, |off, chip| off << 8 | u64::from(chip))
        })
    };
    Converters {
        fault: fault.map(fault_text).unwrap_or_default(),
        drdy_millihertz: drdy_millihertz.unwrap_or(0),
        off_positive: off(Reading::off_positive),
        off_negative: off(Reading::off_negative),
        frames_bad: counters.errors.into_iter().collect(),
    }
}

/// Builds the message with the result of a self-test.
pub fn self_test_message<const CHIPS: usize>(report: &SelfTestReport<CHIPS>) -> SelfTest {
    let chips = report.chips.iter().map(|chip| ChipTest {
        id: chip.id,
        registers_wrong: chip.differing,
        first_wrong: chip.first_differing().map_or(0, ads1299::Register::address),
        frames_bad: chip.bad_frames,
    });
    let channels = report.channels.as_flattened().iter().map(|channel| ChannelTest {
        gain_error: channel.gain_error,
        offset_uv: channel.offset_uv,
        noise_uv: channel.noise_uv,
        shorted_noise_uv: channel.shorted_noise_uv,
        fault: channel_fault(channel.fault),
    });
    SelfTest {
        fault: report.check().err().map(fault_text).unwrap_or_default(),
        drdy_millihertz: report.ready.measured,
        expected_millihertz: report.ready.expected,
        drdy_early: report.ready.early,
        drdy_missed: report.ready.missed,
        chips: chips.collect(),
        channels: channels.collect(),
    }
}

const fn channel_fault(fault: Option<SelfTestFault>) -> ChannelFault {
    match fault {
        None => ChannelFault::None,
        Some(SelfTestFault::Samples { .. }) => ChannelFault::Samples,
        Some(SelfTestFault::Gain { .. }) => ChannelFault::Gain,
        Some(SelfTestFault::Offset { .. }) => ChannelFault::Offset,
        Some(SelfTestFault::Noisy { .. }) => ChannelFault::Noisy,
        Some(SelfTestFault::Silent { .. }) => ChannelFault::Silent,
    }
}

/// Number of converters in the chain.
pub const CHIPS: usize = model::CHANNELS / CHANNELS;

/// Settings of the chain, taken from the model. The driver reads every register back before the
/// chain runs, so a running chain has this rate and this gain.
pub const CONVERTER_SETTINGS: Settings = {
    let rate_hz = model::ADC_RATE_HZ as u32;
    let (clock, rate) = if model::HAS_INTERNAL_CLOCK {
        Rate::of_hz_internal(rate_hz)
    } else {
        Rate::of_hz(rate_hz)
    }
    .expect("reading the artifact has refused a rate that the converters lack");
    Settings {
        wiring: if model::IS_CASCADED { Wiring::Cascaded } else { Wiring::Daisy },
        control: if model::HAS_COMMANDS_ONLY { Control::Commands } else { Control::Pins },
        ..Settings::eeg(clock, rate, GAIN)
    }
};

/// [`Settings::excited`] of the chain while the impedance of the electrodes is measured: the number
/// of channels with an electrode, which are the first ones.
pub const EXCITED: u8 = narrow(model::ELECTRODES);

/// Gain of every channel.
const GAIN: Gain = Gain::of_factor(model::GAIN)
    .expect("reading the artifact has refused a gain that the converters lack");

/// Voltage of one count at the input, in nanovolts, from the gain in the converters' registers.
#[expect(clippy::cast_possible_truncation, reason = "published as f32")]
pub(crate) const LSB_NV: f32 = (GAIN.lsb_uv() * 1000.0) as f32;

const _: () = {
    assert!(
        model::CHANNELS.is_multiple_of(CHANNELS) && CHIPS >= 1 && CHIPS <= link::MAX_CHIPS,
        "the channels are those of whole converters"
    );
    assert!(
        LSB_NV.to_bits() == model::LSB_NV.to_bits(),
        "filters and codes are scaled for the counts of these converters"
    );
};

/// Formats `fault`; text beyond [`MAX_TEXT_BYTES`] is cut off between two characters.
pub fn fault_text(fault: impl fmt::Display) -> String<MAX_TEXT_BYTES> {
    let mut text = Text(String::new());
    // An error means that the text was cut, which is accepted.
    let _ = write!(text, "{fault}");
    text.0
}

/// Text that accepts characters until the first one that does not fit.
struct Text(String<MAX_TEXT_BYTES>);

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            self.0.push(character).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use ads1299::RateError;

    use super::*;

    #[test]
    fn a_message_keeps_the_reports_figures_and_verdict() {
        let mut report = SelfTestReport::<2>::EMPTY;
        report.chips[1].id = 0x3e;
        report.channels[1][3].gain_error = -1.0;
        report.channels[1][3].fault = Some(SelfTestFault::Gain { measured: -1.0, limit: 0.03 });
        report.ready.measured = 511_990;
        let wire = self_test_message(&report);
        assert_eq!((wire.chips.len(), wire.channels.len()), (2, 16));
        assert_eq!((wire.chips[1].id, wire.drdy_millihertz), (0x3e, 511_990));
        assert_eq!(wire.channels[11].fault, ChannelFault::Gain);
        assert!(wire.fault.contains("ADS1299 1") && wire.fault.contains("gain"), "{}", wire.fault);

        report.ready.fault = Some(RateError::NotMeasured { chip: 0 });
        assert!(self_test_message(&report).fault.contains("ADS1299 0"));
        assert_eq!(self_test_message(&SelfTestReport::<2>::EMPTY).fault, "");
    }

    #[test]
    fn a_long_text_is_cut_between_characters() {
        let long: std::string::String = core::iter::repeat_n('ä', MAX_TEXT_BYTES).collect();
        let text = fault_text(std::format!("a{long}"));
        assert_eq!(text.chars().count(), MAX_TEXT_BYTES / 2);
        assert_eq!(fault_text("chip 3"), "chip 3");
    }
}
