//! Audits: compare a device's code with the float network's code of the same window, and the
//! window's signals with the signals decoded from packed blocks.

use std::fmt;
use std::sync::Arc;

use link::{Audit, CodeFormat, MAX_EXPONENT};

use crate::decoder::model::Model;
use crate::decoder::packed::PackedReconstruction;
use crate::device::Device;

/// Limit of the RMS difference between the device's code and the float network's code, as a
/// fraction of the float code's RMS. Half a level is allowed in addition, for rounding. The limit
/// is relative because the error of int8 weights and activations grows with the signal.
///
/// To set the limit, the integer reference was compared with the float network on the windows of
/// EEGMMIDB S001 R11 and R12 whose input is not clipped. The figures are in levels of the code, for
/// the window with the largest RMS difference:
///
/// | model, format | windows | RMS difference | RMS of the code | difference less half a level, as a fraction |
/// | --- | --- | --- | --- | --- |
/// | `signal/model/paper`, int8 | 3,998 | 0.46 | 21 | 0 |
/// | `signal/model/paper`, int16 | 3,998 | 12.5 | 669 | 0.018 |
/// | a model of S001, int16 | 3,694 | 14.2 | up to 778 | 0.023 |
/// | a model of S001, int8-exponent | 3,694 | 16.3 (half a level is 16) | up to 778 | 0.006 |
///
/// The limit is twice the largest fraction.
const RMS_LIMIT: f64 = 0.05;

/// Limit of the difference between the two codes in any single value, as a fraction of the RMS of
/// the float network's code. Half a level is allowed in addition, for rounding.
///
/// In the measurement for [`RMS_LIMIT`], the largest difference less half a level is 0.064 of the
/// code's RMS with `signal/model/paper`, and 0.082 with the model of S001; in golden windows of
/// `signal/model/artifact` it is 0.092. The limit is about 1.3 times the largest fraction. A larger
/// limit would miss all the flipped bits described below.
///
/// In one measurement, which no test repeats, a flipped sign bit in one weight of the linear
/// shortcut changed one value of an int8 code by 1.4 to 2.7 levels on the loudest of 42 windows. A
/// flipped sign bit in a convolution changed no value by more than rounding does, because the
/// convolutions of this model contribute little to the code.
const LARGEST_LIMIT: f64 = 0.12;

/// Additional allowance for the code formats int16 and int8-exponent, in levels. In these formats a
/// level is finer than the units to which the biases and activations of the convolutions are
/// rounded, however quiet the window is. In golden windows of `signal/model/artifact` that are
/// attenuated to between 0 and 3 %, the largest difference less half a level is 4.6 levels. A level
/// of int8 codes is about 32 times as wide and needs no such allowance.
const FINE_LEVELS: f64 = 8.0;

/// A window of the encoder's input, and the code that the device computed from this window.
#[derive(Clone, Debug, PartialEq)]
pub struct AuditedWindow {
    /// Device that sent the window. Its scales apply to the code.
    pub device: Arc<Device>,
    /// Index of the window; the first one after the command `Start` has index 0.
    pub window: u32,
    /// Encoder's input: for each step, oldest first, a plane of scalp-grid cells, row by row; int8.
    pub planes: Vec<i8>,
    /// The device's code, in levels of its format; empty if the device has no network.
    pub levels: Vec<i32>,
    /// Smallest difference between two levels of the code: `2^exponent` for codes with an exponent,
    /// 1 for all other codes.
    pub resolution: u16,
}

impl AuditedWindow {
    pub(crate) fn new(device: Arc<Device>, audit: &Audit) -> AuditedWindow {
        let resolution = 1 << audit.values.exponent().min(MAX_EXPONENT);
        let planes = audit.planes.iter().map(|byte| byte.cast_signed());
        AuditedWindow {
            device,
            window: audit.window,
            planes: planes.collect(),
            levels: audit.values.levels().collect(),
            resolution,
        }
    }

    /// Compares the device's code with the code that the float network of `model` computes from the
    /// same planes, which takes several milliseconds. Returns `None` if the device has no network.
    pub fn compare(&self, model: &Model) -> Option<AuditResult> {
        if self.levels.is_empty() {
            return None;
        }
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
        #[expect(clippy::cast_precision_loss, reason = "at most 256 values")]
        let rms = |squares: f64| (squares / self.levels.len() as f64).sqrt();
        let (rms, signal) = (rms(squares), rms(signal));
        let fine = match self.device.code_format {
            CodeFormat::Int8 => 0.0,
            _ => FINE_LEVELS,
        };
        let rounding = f64::from(self.resolution) / 2.0 + fine;
        Some(AuditResult {
            window: self.window,
            rms,
            rms_limit: rounding + RMS_LIMIT * signal,
            largest,
            largest_limit: rounding + LARGEST_LIMIT * signal,
            value,
            at_rail: self.is_at_rail(),
        })
    }

    /// Compares the window's signals, as the device measured them, with the signals that `packed`
    /// decoded from the same window's packed blocks. Returns `None` if a block was lost, or if an
    /// input was clipped to int8.
    pub fn compare_packed(
        &self,
        model: &Model,
        packed: &PackedReconstruction,
    ) -> Option<PackedError> {
        if self.is_at_rail() {
            return None;
        }
        let (measured, level_uv) = model.electrodes_uv(&self.planes);
        let hop = usize::from(self.device.hop_steps) * model.electrodes().len();
        let (mut squares, mut values) = (0.0, 0.0);
        for (index, measured) in (0..).zip(measured.chunks_exact(hop.max(1))) {
            let decoded = packed.signals(self.window.wrapping_add(index))?;
            for (measured, decoded) in measured.iter().zip(decoded) {
                squares += f64::from(measured - decoded).powi(2);
                values += 1.0;
            }
        }
        // The measured signals are rounded to int8, which adds level^2 / 12 to the mean squared
        // difference. Subtract this part, because it is no error of the packed code.
        let rounding = level_uv * level_uv / 12.0;
        let error = (squares / f64::max(values, 1.0) - rounding).max(0.0);
        Some(PackedError { rms_uv: error.sqrt(), of_variance: error / model.sd_uv().powi(2) })
    }

    /// Returns whether any cell has the smallest or largest int8 value, as after clipping.
    fn is_at_rail(&self) -> bool {
        self.planes.iter().any(|cell| *cell == 127 || *cell == -128)
    }
}

/// Difference between a window's measured signals and the signals decoded from its packed blocks,
/// before later blocks correct them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackedError {
    /// RMS difference of measured and decoded signals over steps and electrodes, microvolts.
    pub rms_uv: f64,
    /// Mean squared difference of measured and decoded signals, as a fraction of the variance of
    /// the model's training data.
    pub of_variance: f64,
}

/// Difference between a device's code and the float network's code of the same window, in levels of
/// the code's format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AuditResult {
    /// Index of the audited window; the first one after the command `Start` has index 0.
    pub window: u32,
    /// RMS difference between the device's code and the float network's code, levels.
    pub rms: f64,
    /// Upper bound of `rms`, levels, for a device that computes its model correctly.
    pub rms_limit: f64,
    /// Largest difference of any single value between the device's code and the float network's
    /// code, levels.
    pub largest: f64,
    /// Upper bound of `largest`, levels, for a device that computes its model correctly.
    pub largest_limit: f64,
    /// Index, within the code, of the value with the largest difference.
    pub value: usize,
    /// Whether a cell of the window has the smallest or largest int8 value, because the input was
    /// clipped. The device's activations can then saturate, so the limits do not apply.
    pub at_rail: bool,
}

impl fmt::Display for AuditResult {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "in window {}, by {:.2} levels RMS (limit {:.2}) and {:.2} levels in value {} (limit {:.2})",
            self.window, self.rms, self.rms_limit, self.largest, self.value, self.largest_limit
        )
    }
}

impl AuditResult {
    /// Returns whether `rms` or `largest` exceeds its limit. Always false for a window with a
    /// clipped cell, to which the limits do not apply.
    pub fn is_wrong(&self) -> bool {
        !self.at_rail && (self.rms > self.rms_limit || self.largest > self.largest_limit)
    }
}
