//! The status `audit` of `/diagnostics`.

use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::decoder::audit::{AuditResult, PackedError};

/// After this number of consecutive audits without a verdict, the status is a warning: one minute,
/// with one audit every 10 s. An audit of a window with a clipped cell has no verdict.
const UNJUDGED_BEFORE_WARNING: u64 = 6;

/// Numbers of audits by result, and the newest result.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AuditCounts {
    pub(crate) compared: u64,
    pub(crate) wrong: u64,
    pub(crate) at_rail: u64,
    /// Number of consecutive audits, up to the newest, whose windows have a clipped cell.
    unjudged: u64,
    pub(crate) newest: Option<AuditResult>,
    /// Number of audited windows that were compared with packed blocks.
    packed_compared: u64,
    /// Number of audited windows that could not be compared with packed blocks.
    packed_skipped: u64,
    /// Number of consecutive windows, up to the newest, that were not compared with packed blocks.
    packed_unjudged: u64,
    packed_newest: Option<PackedError>,
}

impl AuditCounts {
    pub(crate) fn record(&mut self, result: AuditResult) {
        self.compared += 1;
        self.wrong += u64::from(result.is_wrong());
        self.at_rail += u64::from(result.at_rail);
        self.unjudged = if result.at_rail { self.unjudged + 1 } else { 0 };
        self.newest = Some(result);
    }

    /// Records the comparison of a window with its packed blocks. `error` is `None` if they could
    /// not be compared, because a cell was clipped or a block was lost.
    pub(crate) fn record_packed(&mut self, error: Option<PackedError>) {
        if error.is_some() {
            self.packed_compared += 1;
            self.packed_unjudged = 0;
            self.packed_newest = error;
        } else {
            self.packed_skipped += 1;
            self.packed_unjudged += 1;
        }
    }

    /// Returns the status `audit`; `None` before the first audit. `skipped` is the number of audits
    /// that were not evaluated because the decoder thread's queue was full.
    pub(crate) fn status(&self, skipped: u64) -> Option<DiagnosticStatus> {
        let state = match self.newest {
            Some(newest) => self.state(&newest),
            None => self.packed_state()?,
        };
        let mut values = vec![KeyValue::new("windows skipped", &skipped)];
        let newest = self.newest.iter();
        values.extend(newest.flat_map(|newest| self.code_values(newest)));
        values.extend(self.packed_values());
        Some(DiagnosticStatus::new("audit", state, values))
    }

    /// Returns the status's level and message for a device that sends codes.
    fn state(&self, newest: &AuditResult) -> (DiagnosticLevel, String) {
        let AuditResult { window, rms, rms_limit, largest, largest_limit, value, at_rail } =
            *newest;
        if newest.is_wrong() {
            let message = format!(
                "the device's code differs from its model: window {window} by {rms:.2} levels RMS \
                 (limit {rms_limit:.2}), value z{value:03} by {largest:.2} (limit \
                 {largest_limit:.2}); reset the device, and flash it again if this persists"
            );
            (DiagnosticLevel::Error, message)
        } else if self.unjudged >= UNJUDGED_BEFORE_WARNING {
            let message = format!(
                "the last {} windows had cells at the rail and were not judged; see `signal \
                 quality` for the electrode",
                self.unjudged
            );
            (DiagnosticLevel::Warn, message)
        } else if at_rail {
            let message = "the newest window had cells at the rail and was not judged";
            (DiagnosticLevel::Ok, message.to_owned())
        } else {
            let message = format!("the device's code matches its model within {rms:.2} levels RMS");
            (DiagnosticLevel::Ok, message)
        }
    }

    fn code_values(&self, newest: &AuditResult) -> [KeyValue; 7] {
        [
            KeyValue::new("windows compared", &self.compared),
            KeyValue::new("windows wrong", &self.wrong),
            KeyValue::new("windows at the rail, not judged", &self.at_rail),
            KeyValue::new("rms levels", &format!("{:.3}", newest.rms)),
            KeyValue::new("rms limit", &format!("{:.3}", newest.rms_limit)),
            KeyValue::new("largest levels", &format!("{:.3}", newest.largest)),
            KeyValue::new("largest limit", &format!("{:.3}", newest.largest_limit)),
        ]
    }

    /// Returns the status's level and message for a device that sends no codes, only packed blocks;
    /// `None` before the first audit.
    fn packed_state(&self) -> Option<(DiagnosticLevel, String)> {
        if self.packed_unjudged >= UNJUDGED_BEFORE_WARNING {
            let message = format!(
                "the last {} windows had cells at the rail or lost packed blocks and were not compared; see `signal \
                 quality` and `loss`",
                self.packed_unjudged
            );
            return Some((DiagnosticLevel::Warn, message));
        }
        let message = match self.packed_newest {
            Some(PackedError { rms_uv, .. }) if self.packed_unjudged == 0 => {
                format!("the packed blocks match the device's signals within {rms_uv:.2} uV RMS")
            }
            None if self.packed_unjudged == 0 => return None,
            _ => "the newest window had a cell at the rail or a lost packed block and was not compared"
                .to_owned(),
        };
        Some((DiagnosticLevel::Ok, message))
    }

    fn packed_values(&self) -> Vec<KeyValue> {
        if self.packed_compared + self.packed_skipped == 0 {
            return Vec::new();
        }
        let mut values = vec![
            KeyValue::new("packed: windows compared", &self.packed_compared),
            KeyValue::new("packed: windows not compared", &self.packed_skipped),
        ];
        if let Some(error) = self.packed_newest {
            let (rms_uv, of_variance) = (error.rms_uv, error.of_variance);
            let variance = format!("{of_variance:.5}");
            values.push(KeyValue::new("packed: error uV RMS", &format!("{rms_uv:.3}")));
            values.push(KeyValue::new("packed: error of the variance", &variance));
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_without_a_window_to_compare_with_its_blocks_is_a_warning_until_one_is_compared() {
        let mut counts = AuditCounts::default();
        assert_eq!(counts.status(0), None);
        let mut state = |error| {
            counts.record_packed(error);
            let status = counts.status(0).expect("a status");
            (status.level, status.message)
        };
        for _ in 1..UNJUDGED_BEFORE_WARNING {
            let (level, message) = state(None);
            assert_eq!(level, DiagnosticLevel::Ok);
            assert!(message.contains("was not compared"), "{message}");
        }
        assert_eq!(state(None).0, DiagnosticLevel::Warn);
        let error = PackedError { rms_uv: 1.0, of_variance: 0.001 };
        let (level, message) = state(Some(error));
        assert_eq!(level, DiagnosticLevel::Ok);
        assert!(message.contains("within 1.00 uV"), "{message}");
        // A window that was not compared must not show the error of an older window.
        assert!(state(None).1.contains("was not compared"));
        let values = counts.status(0).expect("a status").values;
        let value = |key| values.iter().find(|value| value.key == key);
        let variance = value("packed: error of the variance").expect("the error");
        assert_eq!(variance.value, "0.00100");
        assert!(value("windows compared").is_none(), "no codes: {values:?}");
    }

    #[test]
    fn a_minute_of_audits_at_the_rail_is_a_warning_until_one_is_judged() {
        let result = |at_rail| AuditResult {
            window: 0,
            rms: 0.3,
            rms_limit: 0.6,
            largest: 1.0,
            largest_limit: 1.5,
            value: 0,
            at_rail,
        };
        let mut counts = AuditCounts::default();
        let mut level = |at_rail| {
            counts.record(result(at_rail));
            counts.status(0).map(|status| status.level)
        };
        for _ in 1..UNJUDGED_BEFORE_WARNING {
            assert_eq!(level(true), Some(DiagnosticLevel::Ok));
        }
        assert_eq!(level(true), Some(DiagnosticLevel::Warn));
        assert_eq!(level(false), Some(DiagnosticLevel::Ok));
        assert_eq!(level(true), Some(DiagnosticLevel::Ok));
    }
}
