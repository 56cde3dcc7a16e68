//! The report of a self-test as a table of text.

use std::fmt;

use crate::columns::write_columns;
use crate::query::report::{ChannelReport, ChipReport, DeviceSummary, DrdyReport, SelfTestReport};

/// Writes one line for the device and one for DRDY, a table of the chips, a table of the channels,
/// and the verdict.
impl fmt::Display for SelfTestReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(formatter, "device  {}", self.device)?;
        writeln!(formatter, "DRDY    {}", self.ready)?;
        if !self.chips.is_empty() {
            writeln!(formatter)?;
            let header = ["chip", "ID", "registers", "frames bad"];
            let rows = self.chips.iter().map(chip_row);
            write_columns(formatter, header, [true, false, false, true], rows)?;
        }
        if !self.channels.is_empty() {
            writeln!(formatter)?;
            let header = [
                "channel",
                "electrode",
                "gain error %",
                "offset uV",
                "noise uV rms",
                "shorted uV rms",
                "verdict",
            ];
            let right = [true, false, true, true, true, true, false];
            write_columns(
                formatter,
                header,
                right,
                self.channels.iter().map(channel_row),
            )?;
        }
        write!(formatter, "\n{}", self.verdict)
    }
}

impl fmt::Display for DeviceSummary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let DeviceSummary {
            board,
            firmware,
            uid,
            reset_cause,
            fault,
        } = self;
        write!(
            formatter,
            "{board}, firmware {firmware}, uid {uid}, started by {reset_cause}"
        )?;
        if fault.is_empty() {
            return Ok(());
        }
        write!(formatter, "; it reports: {fault}")
    }
}

impl fmt::Display for DrdyReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let DrdyReport {
            rate_hz,
            expected_hz,
            ppm,
            early,
            missed,
        } = self;
        match (rate_hz, ppm) {
            (Some(rate_hz), Some(ppm)) => write!(
                formatter,
                "{rate_hz:.3} Hz, {ppm:+.0} ppm off the {expected_hz} Hz that were set"
            )?,
            (Some(rate_hz), None) => write!(formatter, "{rate_hz:.3} Hz")?,
            (None, _) => write!(formatter, "not measured, {expected_hz} Hz were set")?,
        }
        write!(formatter, "; {early} early, {missed} missed")
    }
}

fn chip_row(chip: &ChipReport) -> [String; 4] {
    let registers = match &chip.first_wrong {
        None => "all kept".to_owned(),
        Some(first) => format!("{} wrong, the first is {first}", chip.registers_wrong),
    };
    [
        chip.chip.to_string(),
        format!("0x{:02X} {}", chip.id, chip.part),
        registers,
        chip.frames_bad.to_string(),
    ]
}

fn channel_row(channel: &ChannelReport) -> [String; 7] {
    let noise = |uv: Option<f32>| or_dash(uv.map(|uv| format!("{uv:.2}")));
    [
        channel.channel.to_string(),
        channel.label.clone(),
        or_dash(channel.gain_error_percent.map(|off| format!("{off:+.2}"))),
        or_dash(channel.offset_uv.map(|uv| format!("{uv:+.1}"))),
        noise(channel.noise_uv),
        noise(channel.shorted_noise_uv),
        channel.verdict.clone(),
    ]
}

/// Returns `measured`, or "-" if there is no measurement.
fn or_dash(measured: Option<String>) -> String {
    measured.unwrap_or_else(|| "-".to_owned())
}
