//! Identity and capabilities of a device.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::code::{CodeFormat, MAX_NUMBERS};

/// Length of the longest text in [`Hello`], [`Capabilities::filters`],
/// [`Converters`](crate::Converters) and [`SelfTest`](crate::SelfTest), bytes of UTF-8.
pub const MAX_TEXT_BYTES: usize = 256;

/// Length of the longest [`Capabilities::labels`], bytes: 64 labels of 7 bytes and a blank each.
pub const MAX_LABELS_BYTES: usize = 512;

/// Identity of the device: sent at start-up and in answer to `Identify`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello<'a> {
    /// Version and commit of the firmware, as in `0.1.0 5d4b736`; at most [`MAX_TEXT_BYTES`] bytes.
    pub firmware: &'a str,
    /// Name of the board, such as `nucleo-h743zi2` or `host-sim`. At most [`MAX_TEXT_BYTES`] bytes.
    pub board: &'a str,
    /// Unique id of the microcontroller (96 bits on every STM32); a simulator invents one.
    pub chip_uid: [u8; 12],
    /// First 8 bytes of the SHA-256 over the model.
    pub model_id: [u8; 8],
    /// Number that differs from boot to boot: a change means that the device was reset.
    pub session_id: u32,
    /// Cause of the last start, from the microcontroller's reset flags or from the failure record
    /// that survives a reset.
    pub reset_cause: ResetCause,
    /// Fault of this start (such as a damaged model or a missing clock), or of the previous run
    /// (its panic message or fault registers); empty without a fault. At most [`MAX_TEXT_BYTES`]
    /// bytes.
    pub fault: &'a str,
}

byte_enum! {
    /// Reason for a device's start; one byte on the wire.
    pub enum ResetCause {
        /// 0: the device cannot determine the cause.
        NotKnown = 0,
        /// 1: the supply was switched on.
        PowerOn = 1,
        /// 2: the reset pin, or the debugger.
        Pin = 2,
        /// 3: the supply dropped below its limit.
        BrownOut = 3,
        /// 4: a watchdog expired.
        Watchdog = 4,
        /// 5: software restarted the device without a fault.
        Software = 5,
        /// 6: a fault or a panic; [`Hello::fault`] has the details.
        Fault = 6,
        _ => "Any other: a cause newer than this host.",
    }
}

/// Rates, dimensions, labels and code scales of the device; follows every `Hello`.
///
/// Constant until the next `Hello`, except for `mains_hz` and `filters`: a `Start` with another
/// mains frequency changes them, and the device then sends this message again before the `Ack`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Capabilities<'a> {
    /// Samples per second of the ADC.
    pub adc_rate_hz: u16,
    /// Steps (planes) per second at the encoder's input, after decimation.
    pub step_rate_hz: u16,
    /// Steps in one window.
    pub window_steps: u8,
    /// Steps from one window to the next; codes per second = `step_rate_hz / hop_steps`.
    pub hop_steps: u8,
    /// ADC channels, the unused ones included.
    pub channels: u8,
    /// Nanovolts per count, computed from the registers that the device read back: 22.351742 for an
    /// ADS1299 at gain 24 with a reference of 4.5 V.
    pub lsb_nv: f32,
    /// Mains frequency that the active notch removes, 50 or 60 Hz.
    pub mains_hz: u8,
    /// Delay of the filter chain in its pass band, microseconds: a step with the time `t`
    /// represents the signal that was at the electrodes at `t - group_delay_us`. A code has the
    /// time of its last step.
    pub group_delay_us: u32,
    /// Electrode labels, blank-separated, in the order of the montage (ADC channel order). At most
    /// [`MAX_LABELS_BYTES`] bytes.
    pub labels: &'a str,
    /// Description of the filter chain, for human readers. At most [`MAX_TEXT_BYTES`] bytes.
    pub filters: &'a str,
    /// Format of all codes of this device; it is part of the model.
    pub code_format: CodeFormat,
    /// Scale of each code value; a code has as many values as there are scales. The decoder
    /// network's input is `z = (level - code_zero_point) * code_scale`, with the
    /// [levels](crate::CodeValues::levels) of the code. Positive and finite.
    pub code_scale: Vec<f32, MAX_NUMBERS>,
    /// For each value of a code, the level that stands for `z = 0`; always 0 in the formats other
    /// than [`CodeFormat::Int8`].
    pub code_zero_point: Vec<i8, MAX_NUMBERS>,
}

/// Electrodes whose samples are a substitute, because the recording that the device plays lacks
/// them. Sent between `Hello` and `Capabilities`, except by a device that measures all electrodes.
///
/// In both bit sets, bit n is electrode n of
/// [`Capabilities::labels`](crate::Capabilities::labels).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Substitutes {
    /// Electrodes interpolated from other electrodes.
    pub interpolated: u64,
    /// Electrodes without a signal: every sample is 0.
    pub zero: u64,
}

impl Substitutes {
    /// No substitutes: every electrode is measured.
    pub const NONE: Self = Self { interpolated: 0, zero: 0 };

    /// Formats the electrodes of both sets by their labels, such as "interpolated: F1 F2; zero:
    /// Cz". `labels` are the labels in [`Capabilities::labels`](crate::Capabilities::labels).
    pub fn named<'a>(
        self,
        labels: impl Iterator<Item = &'a str> + Clone,
    ) -> impl core::fmt::Display {
        core::fmt::from_fn(move |f| {
            let mut separator = "";
            for (kind, set) in [("interpolated", self.interpolated), ("zero", self.zero)] {
                let mut start = kind;
                for (_, label) in
                    labels.clone().enumerate().filter(|(n, _)| *n < 64 && set >> n & 1 == 1)
                {
                    if start == kind {
                        write!(f, "{separator}{kind}:")?;
                    }
                    (start, separator) = ("", "; ");
                    write!(f, " {label}")?;
                }
            }
            Ok(())
        })
    }
}
