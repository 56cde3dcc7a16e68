//! The status `converters` of `/diagnostics`.

use link::Converters;
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::device::channel_label;

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
    /// Creates the report from the device's message `converters`. Bad frames that `before` has
    /// already reported to `/diagnostics` do not count as new.
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

    /// Returns the labels of all electrodes that have no contact according to the newest report.
    pub(crate) fn electrodes_off(&self, labels: &[String]) -> Vec<String> {
        off(self.off_positive | self.off_negative, labels)
    }

    /// Returns the status `converters`. The message names faults; the values of the status are the
    /// DRDY rate, the electrodes without contact and each chip's bad frames. `drift_ppm` is the
    /// drift of the device's clock, which stamps the edges of DRDY; `None` if it is not known.
    pub(crate) fn status(
        &mut self,
        adc_rate_hz: u16,
        labels: &[String],
        drift_ppm: Option<f64>,
    ) -> DiagnosticStatus {
        let new = |(chip, bad): (usize, &u32)| {
            let reported = self.reported.get(chip).copied().unwrap_or(0);
            let since = bad.wrapping_sub(reported);
            (since > 0).then(|| format!("chip {chip} ({since})"))
        };
        let frames = self.frames_bad.iter().enumerate();
        let frames: Vec<String> = frames.filter_map(new).collect();
        self.reported.clone_from(&self.frames_bad);
        let off = self.electrodes_off(labels);
        let oscillator = oscillator_warning(self.drdy_millihertz, adc_rate_hz, drift_ppm);
        let warnings = [("frames bad since the last report", frames), ("electrodes off", off)]
            .into_iter()
            .filter(|(_, which)| !which.is_empty())
            .map(|(what, which)| format!("{what}: {}", which.join(" ")));
        let warnings: Vec<String> = warnings.chain(oscillator).collect();
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
        DiagnosticStatus::new("converters", state, values)
    }
}

/// Error of the converters' oscillator above which the status warns, ppm. At 1,000 ppm a notch of Q
/// 30 passes 6 % of the mains' amplitude.
const MAX_OSCILLATOR_PPM: f64 = 1_000.0;

/// Returns a warning if the converters' sampling rate, measured by the host's clock, differs from
/// the set rate. `drdy_millihertz` is the rate measured by the device's clock; `drift_ppm` relates
/// the two clocks.
fn oscillator_warning(
    drdy_millihertz: u32,
    adc_rate_hz: u16,
    drift_ppm: Option<f64>,
) -> Option<String> {
    let hz = f64::from(drdy_millihertz) / 1000.0 / (1.0 + drift_ppm? * 1e-6);
    let ppm = (hz / f64::from(adc_rate_hz) - 1.0) * 1e6;
    let is_off = drdy_millihertz > 0 && ppm.abs() > MAX_OSCILLATOR_PPM;
    is_off.then(|| {
        format!(
            "the converters sample at {hz:.3} Hz, {ppm:+.0} ppm off the {adc_rate_hz} Hz that were set, \
             and the filters' frequencies are off by as much. The oscillator inside an ADS1299 can be \
             off by 25,000 ppm; with an external one, check CLK and CLKSEL: 2.048 MHz in place of \
             2.097152 MHz makes -23,438 ppm, the reverse +24,000"
        )
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oscillator_is_judged_by_the_hosts_clock() {
        let warning = |millihertz, drift| oscillator_warning(millihertz, 512, drift);
        assert_eq!(warning(512_100, Some(0.0)), None);
        assert_eq!(warning(512_000, None), None, "the drift is not known yet");
        assert_eq!(warning(0, Some(0.0)), None, "no rate is known");
        // The device's clock is 1 % slow, so it counts 1 % more edges in each of its seconds.
        assert_eq!(warning(517_120, Some(10_000.0)), None);
        let text = warning(500_000, Some(0.0)).expect("a warning");
        assert!(text.contains("500.000 Hz, -23438 ppm off the 512 Hz"), "{text}");
        assert!(warning(512_000, Some(10_000.0)).is_some());
    }
}
