//! Whether the device still computes what its model says.

use std::sync::Arc;

use link::{Audit, CODE_LEN, CodeValues, MAX_EXPONENT};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::diagnosis::entry;
use crate::{Device, Model};

/// How far a code may lie from the float network's, beside half a step of rounding, as a part of the
/// code's own RMS: what int8 weights and activations add grows with the signal.
///
/// Measured with model 2baa001418a09107 on the 3,998 windows of EEGMMIDB S001 R11 and R12, none of
/// which has a cell at the rail, integer reference against floats, in steps: int8 codes differ by
/// 0.29 RMS in the median (1/sqrt(12) is rounding) and 0.46 at most, where the signal has 21; int16
/// codes by 1.4 and 12.5, where it has 669. Half a step taken out that is at most 0.018 of the
/// signal; this is nearly three times as much.
const RMS_OF_SIGNAL: f64 = 0.05;

/// The same for the value that differs most: there 1.76 steps at most where the signal has 20
/// (int8), 41.9 where it has 669 (int16); half a step taken out 0.064 of the signal. The sign bit of
/// a single weight of the shortcut moves one value by 1.4 to 2.7 steps on the loudest of 42 windows;
/// the limit is 1.05 at the median signal of 5.5. One of a convolution moves none by more than
/// rounding does, because this model's convolutions add a hair: it matters as little as it shows.
const LARGEST_OF_SIGNAL: f64 = 0.1;

/// A window that the device's encoder read, and the code that it made of it.
#[derive(Clone, Debug, PartialEq)]
pub struct AuditedWindow {
    /// Whose.
    pub device: Arc<Device>,
    /// Index of the window since Start.
    pub window: u32,
    /// Its planes, the oldest first, row-major; steps of the encoder's input.
    pub planes: Vec<i8>,
    /// The code, in steps of its format.
    pub steps: Box<[i32; CODE_LEN]>,
    /// Steps from one value of the code to the next: a power of two with an exponent, else 1.
    pub resolution: u16,
}

impl AuditedWindow {
    pub(crate) fn new(device: Arc<Device>, audit: &Audit) -> AuditedWindow {
        let resolution = match audit.values {
            CodeValues::Int8Exponent { exponent, .. } => 1 << exponent.min(MAX_EXPONENT),
            CodeValues::Int8(_) | CodeValues::Int16(_) => 1,
        };
        let planes = audit.planes.iter().map(|byte| byte.cast_signed());
        AuditedWindow {
            device,
            window: audit.window,
            planes: planes.collect(),
            steps: Box::new(audit.values.levels()),
            resolution,
        }
    }

    /// The code of the same planes by the float network, beside the device's. Takes some
    /// milliseconds.
    pub fn compare(&self, model: &Model) -> AuditResult {
        let float = self.device.steps_of(&model.encode(&self.planes));
        let (mut squares, mut signal) = (0.0, 0.0);
        let (mut largest, mut value) = (0.0, 0);
        let device = self.steps.iter().zip(self.device.zero_points());
        for (index, (float, (step, zero_point))) in float.iter().zip(device).enumerate() {
            let difference = (f64::from(*step) - float).abs();
            squares += difference * difference;
            signal += (float - f64::from(*zero_point)).powi(2);
            if difference > largest {
                (largest, value) = (difference, index);
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "128")]
        let rms = |squares: f64| (squares / CODE_LEN as f64).sqrt();
        let (rms, signal) = (rms(squares), rms(signal));
        let rounding = f64::from(self.resolution) / 2.0;
        AuditResult {
            window: self.window,
            rms,
            rms_limit: rounding + RMS_OF_SIGNAL * signal,
            largest,
            largest_limit: rounding + LARGEST_OF_SIGNAL * signal,
            value,
            at_rail: self.planes.iter().any(|step| *step == 127 || *step == -128),
        }
    }
}

/// How far a device's code lies from the float network's, in steps of the code's format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AuditResult {
    /// Index of the window.
    pub window: u32,
    /// RMS over the values.
    pub rms: f64,
    /// What `rms` stays below as long as the device computes what it was built for.
    pub rms_limit: f64,
    /// Of the value that differs most.
    pub largest: f64,
    /// What `largest` stays below.
    pub largest_limit: f64,
    /// The value that differs most.
    pub value: usize,
    /// A cell of the window stood at the rail of int8: then activations saturate as well, and the
    /// limits say nothing.
    pub at_rail: bool,
}

impl AuditResult {
    /// Whether the device computed something else than its model.
    pub fn is_wrong(&self) -> bool {
        !self.at_rail && (self.rms > self.rms_limit || self.largest > self.largest_limit)
    }
}

/// Audits in a row that could not be judged before it is a warning: a minute's.
const BLIND: u64 = 6;

/// What audits have found until now.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AuditCounts {
    pub(crate) compared: u64,
    pub(crate) wrong: u64,
    pub(crate) at_rail: u64,
    /// Of these, the ones since the last that was judged.
    unjudged: u64,
    pub(crate) newest: Option<AuditResult>,
}

impl AuditCounts {
    pub(crate) fn add(&mut self, result: AuditResult) {
        self.compared += 1;
        self.wrong += u64::from(result.is_wrong());
        self.at_rail += u64::from(result.at_rail);
        self.unjudged = if result.at_rail { self.unjudged + 1 } else { 0 };
        self.newest = Some(result);
    }

    /// One status, from the first audit on; `skipped` ones found no time.
    pub(crate) fn status(&self, skipped: u64) -> Option<DiagnosticStatus> {
        let newest = self.newest?;
        let AuditResult {
            window,
            rms,
            rms_limit,
            largest,
            largest_limit,
            value,
            at_rail,
        } = newest;
        let state = if newest.is_wrong() {
            let message = format!(
                "the device does not compute its model: window {window} differs by {rms:.2} steps \
                 RMS (limit {rms_limit:.2}), value z{value:03} by {largest:.2} (limit \
                 {largest_limit:.2}); reset the device, and flash it again if this stays"
            );
            (DiagnosticLevel::Error, message)
        } else if self.unjudged >= BLIND {
            let message = format!(
                "the last {} windows stood at the rail and were not judged; see `signal quality` \
                 for the electrode",
                self.unjudged
            );
            (DiagnosticLevel::Warn, message)
        } else if at_rail {
            let message = "the newest window stood at the rail and was not judged";
            (DiagnosticLevel::Ok, message.to_owned())
        } else {
            let message = format!("the device computes its model, {rms:.2} steps RMS from floats");
            (DiagnosticLevel::Ok, message)
        };
        let values = vec![
            KeyValue::new("windows compared", &self.compared),
            KeyValue::new("windows wrong", &self.wrong),
            KeyValue::new("windows at the rail, not judged", &self.at_rail),
            KeyValue::new("windows skipped", &skipped),
            KeyValue::new("rms steps", &format!("{rms:.3}")),
            KeyValue::new("rms limit", &format!("{rms_limit:.3}")),
            KeyValue::new("largest steps", &format!("{largest:.3}")),
            KeyValue::new("largest limit", &format!("{largest_limit:.3}")),
        ];
        Some(entry("audit", state, values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_in_which_nothing_could_be_judged_is_a_warning_until_something_is() {
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
            counts.add(result(at_rail));
            counts.status(0).map(|status| status.level)
        };
        for _ in 1..BLIND {
            assert_eq!(level(true), Some(DiagnosticLevel::Ok));
        }
        assert_eq!(level(true), Some(DiagnosticLevel::Warn));
        assert_eq!(level(false), Some(DiagnosticLevel::Ok));
        assert_eq!(level(true), Some(DiagnosticLevel::Ok));
    }
}
