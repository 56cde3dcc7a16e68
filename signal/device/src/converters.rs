//! Wire messages about the converters, built from the driver's types.

use ads1299::{Error, Reading, SamplerCounters, SelfTestFault, SelfTestReport};
use link::{ChannelFault, ChannelTest, ChipTest, Converters, SelfTest};

use crate::fault_text::fault_text;

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
    let channels = report
        .channels
        .as_flattened()
        .iter()
        .map(|channel| ChannelTest {
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

#[cfg(test)]
mod tests {
    use ads1299::RateError;

    use super::*;

    #[test]
    fn a_message_keeps_the_reports_figures_and_verdict() {
        let mut report = SelfTestReport::<2>::EMPTY;
        report.chips[1].id = 0x3e;
        report.channels[1][3].gain_error = -1.0;
        report.channels[1][3].fault = Some(SelfTestFault::Gain {
            measured: -1.0,
            limit: 0.03,
        });
        report.ready.measured = 511_990;
        let wire = self_test_message(&report);
        assert_eq!((wire.chips.len(), wire.channels.len()), (2, 16));
        assert_eq!((wire.chips[1].id, wire.drdy_millihertz), (0x3e, 511_990));
        assert_eq!(wire.channels[11].fault, ChannelFault::Gain);
        assert!(
            wire.fault.contains("ADS1299 1") && wire.fault.contains("gain"),
            "{}",
            wire.fault
        );

        report.ready.fault = Some(RateError::NotMeasured { chip: 0 });
        assert!(self_test_message(&report).fault.contains("ADS1299 0"));
        assert_eq!(self_test_message(&SelfTestReport::<2>::EMPTY).fault, "");
    }
}
