//! Audits: each compares a code from the device with the float network's code of the same window.

use std::sync::Arc;

use link::{Audit, CODE_LEN, CodeValues, MAX_EXPONENT};

use crate::decoder::model::Model;
use crate::device::Device;

/// Limit of the RMS difference between a device's code and the float network's, beyond half a level
/// of rounding, as a fraction of the code's RMS. The error of int8 weights and activations grows
/// with the signal.
///
/// Measured with model 2baa001418a09107 on the 3,998 windows of EEGMMIDB S001 R11 and R12, none
/// with a clipped input, integer reference against floats, in quantisation levels:
///
/// | format | median RMS difference | worst window | RMS of that window's code |
/// | --- | --- | --- | --- |
/// | int8 | 0.29 (rounding alone: 1/sqrt(12)) | 0.46 | 21 |
/// | int16 | 1.4 | 12.5 | 669 |
///
/// After half a level is subtracted, the worst difference is 0.018 of the code's RMS. The limit is
/// nearly three times that.
const RMS_LIMIT: f64 = 0.05;

/// Limit of the largest difference of a single value between the two codes, beyond half a level of
/// rounding, as a fraction of the code's RMS.
///
/// In the measurement for [`RMS_LIMIT`], the largest difference is 1.76 levels in an int8 code
/// whose RMS is 20 levels, and 41.9 levels in an int16 code whose RMS is 669 levels. After half a
/// level is subtracted, the worst difference is 0.064 of the code's RMS.
///
/// A flipped sign bit in one weight of the shortcut changes one value by 1.4 to 2.7 levels on the
/// loudest of 42 windows. At the median RMS of 5.5 levels, this limit and the half level allow 1.05
/// levels. A flipped sign bit in a convolution changes no value by more than rounding does, because
/// the convolutions of this model contribute little to the code.
const LARGEST_LIMIT: f64 = 0.1;

/// A window that the device's encoder read, and the code that the device computed from it.
#[derive(Clone, Debug, PartialEq)]
pub struct AuditedWindow {
    /// Device that sent the audit; its scales apply to the code.
    pub device: Arc<Device>,
    /// Index of the window since `Start`.
    pub window: u32,
    /// Planes of the window, oldest first, each row by row; int8 levels of the encoder's input.
    pub planes: Vec<i8>,
    /// The device's code, in quantisation levels of its format.
    pub levels: Box<[i32; CODE_LEN]>,
    /// Distance between adjacent values of the code, in levels: a power of two for codes with an
    /// exponent, else 1.
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
            levels: Box::new(audit.values.levels()),
            resolution,
        }
    }

    /// Compares the device's code with the code that the float network computes from the same
    /// planes. Takes several milliseconds.
    pub fn compare(&self, model: &Model) -> AuditResult {
        let float = self.device.code_levels(&model.encode(&self.planes));
        let (mut squares, mut signal) = (0.0, 0.0);
        let (mut largest, mut value) = (0.0, 0);
        let device = self.levels.iter().zip(self.device.zero_points());
        for (index, (float, (level, zero_point))) in float.iter().zip(device).enumerate() {
            let difference = (f64::from(*level) - float).abs();
            squares += difference * difference;
            signal += (float - f64::from(*zero_point)).powi(2);
            if difference > largest {
                (largest, value) = (difference, index);
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "128 values")]
        let rms = |squares: f64| (squares / CODE_LEN as f64).sqrt();
        let (rms, signal) = (rms(squares), rms(signal));
        let rounding = f64::from(self.resolution) / 2.0;
        AuditResult {
            window: self.window,
            rms,
            rms_limit: rounding + RMS_LIMIT * signal,
            largest,
            largest_limit: rounding + LARGEST_LIMIT * signal,
            value,
            at_rail: self.planes.iter().any(|cell| *cell == 127 || *cell == -128),
        }
    }
}

/// Difference between a device's code and the float network's, in levels of the code's format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AuditResult {
    /// Index of the audited window since `Start`.
    pub window: u32,
    /// RMS difference over all values, levels.
    pub rms: f64,
    /// Upper bound of `rms`, levels, for a device that computes its model correctly.
    pub rms_limit: f64,
    /// Largest difference of any value, levels.
    pub largest: f64,
    /// Upper bound of `largest`, levels, for a device that computes its model correctly.
    pub largest_limit: f64,
    /// Index in the code of the value with the largest difference.
    pub value: usize,
    /// Whether a cell of the window is clipped to the smallest or largest int8. The device's
    /// activations saturate then, so neither limit applies.
    pub at_rail: bool,
}

impl AuditResult {
    /// Returns whether the difference exceeds a limit. Never true for a window with a clipped cell,
    /// to which the limits do not apply.
    pub fn is_wrong(&self) -> bool {
        !self.at_rail && (self.rms > self.rms_limit || self.largest > self.largest_limit)
    }
}
