//! The status `converters` of `/diagnostics`.

use link::Converters;
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::device::channel_label;
use crate::diagnostics::new_status;

/// Newest report about the chain of converters, and the numbers of bad frames that `/diagnostics`
/// has already reported.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChainReport {
    fault: String,
    drdy_millihertz: u32,
    off_positive: u64,
    off_negative: u64,
    frames_bad: Vec<u32>,
    /// Number of bad frames of each chip when `/diagnostics` was last published.
    reported: Vec<u32>,
}

impl ChainReport {
    /// Creates the report from the device's message `converters`. Of the bad frames, those that
    /// `before` has already reported to `/diagnostics` do not count as new.
    pub(crate) fn from_message(
        before: Option<&ChainReport>,
        converters: &Converters,
    ) -> ChainReport {
        let unchanged = before.is_some_and(|before| before.fault == *converters.fault);
        if !unchanged && !converters.fault.is_empty() {
            tracing::error!(fault = %converters.fault, "the device's converters do not run");
        }
        ChainReport {
            fault: converters.fault.as_str().to_owned(),
            drdy_millihertz: converters.drdy_millihertz,
            off_positive: converters.off_positive,
            off_negative: converters.off_negative,
            frames_bad: converters.frames_bad.to_vec(),
            // Bad frames in the first message may have occurred before the connection, so they do
            // not count as new.
            reported: match before {
                Some(before) => before.reported.clone(),
                None => converters.frames_bad.to_vec(),
            },
        }
    }

    /// Returns the labels of all electrodes without contact, by the newest report.
    pub(crate) fn electrodes_off(&self, labels: &[String]) -> Vec<String> {
        off(self.off_positive | self.off_negative, labels)
    }

    /// Returns the status `converters`. The message names faults; the values of the status are the
    /// DRDY rate, the electrodes without contact and each chip's bad frames.
    pub(crate) fn status(&mut self, adc_rate_hz: u16, labels: &[String]) -> DiagnosticStatus {
        let new = |(chip, bad): (usize, &u32)| {
            let reported = self.reported.get(chip).copied().unwrap_or(0);
            let since = bad.wrapping_sub(reported);
            (since > 0).then(|| format!("chip {chip} ({since})"))
        };
        let frames = self.frames_bad.iter().enumerate();
        let frames: Vec<String> = frames.filter_map(new).collect();
        self.reported.clone_from(&self.frames_bad);
        let off = self.electrodes_off(labels);
        let warnings: Vec<String> = [
            ("frames bad since the last report", frames),
            ("electrodes off", off),
        ]
        .into_iter()
        .filter(|(_, which)| !which.is_empty())
        .map(|(what, which)| format!("{what}: {}", which.join(" ")))
        .collect();
        let state = if !self.fault.is_empty() {
            (DiagnosticLevel::Error, self.fault.clone())
        } else if !warnings.is_empty() {
            (DiagnosticLevel::Warn, warnings.join("; "))
        } else {
            let chips = self.frames_bad.len();
            (DiagnosticLevel::Ok, format!("{chips} chips convert"))
        };
        let drdy = rate(self.drdy_millihertz, adc_rate_hz);
        let mut values = vec![KeyValue::new("DRDY", &drdy)];
        for (name, channels) in [
            ("positive electrodes off", self.off_positive),
            ("negative electrodes off", self.off_negative),
        ] {
            values.push(KeyValue::new(name, &off_names(channels, labels)));
        }
        for (chip, bad) in self.frames_bad.iter().enumerate() {
            values.push(KeyValue::new(&format!("chip {chip}: frames bad"), bad));
        }
        new_status("converters", state, values)
    }
}

/// Formats the measured DRDY rate and its deviation, such as "512.010 Hz, +20 ppm off the 512 Hz
/// that were set".
fn rate(drdy_millihertz: u32, adc_rate_hz: u16) -> String {
    if drdy_millihertz == 0 {
        return "not known".to_owned();
    }
    let hz = f64::from(drdy_millihertz) / 1000.0;
    let ppm = (hz / f64::from(adc_rate_hz) - 1.0) * 1e6;
    format!("{hz:.3} Hz, {ppm:+.0} ppm off the {adc_rate_hz} Hz that were set")
}

/// Returns the labels of the channels whose bit in `channels` is set. Bit 0 is the first channel.
fn off(channels: u64, labels: &[String]) -> Vec<String> {
    let off = (0..64).filter(|channel| channels >> channel & 1 == 1);
    off.map(|channel| channel_label(labels, channel)).collect()
}

fn off_names(channels: u64, labels: &[String]) -> String {
    match off(channels, labels) {
        none if none.is_empty() => "none".to_owned(),
        some => some.join(" "),
    }
}
