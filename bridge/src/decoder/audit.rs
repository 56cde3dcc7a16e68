//! Whether the device still computes what its model says.

use std::sync::Arc;

use link::{Audit, CODE_LEN, CodeValues, MAX_EXPONENT};

use crate::decoder::model::Model;
use crate::device::Device;

/// How far a code may lie from the float network's, beside half a step of rounding, as a part of the
/// code's own RMS: what int8 weights and activations add grows with the signal.
///
/// Measured with model 2baa001418a09107 on the 3,998 windows of EEGMMIDB S001 R11 and R12, none of
/// which has a cell at the rail, integer reference against floats, in steps: int8 codes differ by
/// 0.29 RMS in the median (1/sqrt(12) is rounding) and 0.46 at most, where the signal has 21; int16
/// codes by 1.4 and 12.5, where it has 669. Half a step taken out that is at most 0.018 of the
/// signal; this is nearly three times as much.
const RMS_LIMIT: f64 = 0.05;

/// The same for the value that differs most: there 1.76 steps at most where the signal has 20
/// (int8), 41.9 where it has 669 (int16); half a step taken out 0.064 of the signal. The sign bit of
/// a single weight of the shortcut moves one value by 1.4 to 2.7 steps on the loudest of 42 windows;
/// the limit is 1.05 at the median signal of 5.5. One of a convolution moves none by more than
/// rounding does, because this model's convolutions add a hair: it matters as little as it shows.
const LARGEST_LIMIT: f64 = 0.1;

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
    pub levels: Box<[i32; CODE_LEN]>,
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
            levels: Box::new(audit.values.steps()),
            resolution,
        }
    }

    /// The code of the same planes by the float network, beside the device's. Takes some
    /// milliseconds.
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
        #[expect(clippy::cast_precision_loss, reason = "128")]
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
