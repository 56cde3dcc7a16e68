//! Identity and capabilities of a device.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::code::{CodeFormat, MAX_NUMBERS};

/// Longest text in [`Hello`], [`Capabilities::filters`], [`Converters`](crate::Converters) and
/// [`SelfTest`](crate::SelfTest), bytes of UTF-8.
pub const MAX_TEXT_BYTES: usize = 256;

/// Longest [`Capabilities::labels`], bytes: 64 labels of 7 bytes, each with a blank after it.
pub const MAX_LABELS_BYTES: usize = 512;

/// Identity of the device: sent at start-up and in answer to `Identify`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello<'a> {
    /// Version and commit of the firmware, such as `0.1.0 5d4b736`. At most [`MAX_TEXT_BYTES`]
    /// bytes.
    pub firmware: &'a str,
    /// Name of the board, such as `nucleo-h743zi2` or `host-sim`. At most [`MAX_TEXT_BYTES`] bytes.
    pub board: &'a str,
    /// Unique id of the microcontroller (96 bits on every STM32); a simulator invents one.
    pub chip_uid: [u8; 12],
    /// First 8 bytes of the SHA-256 over the model.
    pub model_id: [u8; 8],
    /// Differs from boot to boot: a change means that the device was reset.
    pub session_id: u32,
    /// Cause of the last start, from the microcontroller's reset flags or from the record of a
    /// failure.
    pub reset_cause: ResetCause,
    /// Fault of this start, such as a damaged model or a missing clock, or the panic message or
    /// fault registers of the previous run; empty without a fault. At most [`MAX_TEXT_BYTES`]
    /// bytes.
    pub fault: &'a str,
}

/// Reason for a device's start; one byte on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum ResetCause {
    /// 0: the device cannot determine the cause.
    NotKnown,
    /// 1: the supply was switched on.
    PowerOn,
    /// 2: the reset pin, or the debugger.
    Pin,
    /// 3: the supply dropped below its limit.
    BrownOut,
    /// 4: a watchdog expired.
    Watchdog,
    /// 5: software restarted the device without a fault.
    Software,
    /// 6: a fault or a panic; [`Hello::fault`] has the details.
    Fault,
    /// Any other: a cause newer than this host.
    Newer(u8),
}

impl From<u8> for ResetCause {
    fn from(byte: u8) -> ResetCause {
        match byte {
            0 => ResetCause::NotKnown,
            1 => ResetCause::PowerOn,
            2 => ResetCause::Pin,
            3 => ResetCause::BrownOut,
            4 => ResetCause::Watchdog,
            5 => ResetCause::Software,
            6 => ResetCause::Fault,
            newer => ResetCause::Newer(newer),
        }
    }
}

impl From<ResetCause> for u8 {
    fn from(cause: ResetCause) -> u8 {
        match cause {
            ResetCause::NotKnown => 0,
            ResetCause::PowerOn => 1,
            ResetCause::Pin => 2,
            ResetCause::BrownOut => 3,
            ResetCause::Watchdog => 4,
            ResetCause::Software => 5,
            ResetCause::Fault => 6,
            ResetCause::Newer(newer) => newer,
        }
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
    /// Scale of each code value; a code has as many values as there are scales. The decoder network's
    /// input is `z = (level - code_zero_point) * code_scale`, with the [levels](crate::CodeValues::levels)
    /// of the code. Positive and finite.
    pub code_scale: Vec<f32, MAX_NUMBERS>,
    /// Level of each code value that stands for `z = 0`; always 0 in the formats other than
    /// [`CodeFormat::Int8`].
    pub code_zero_point: Vec<i8, MAX_NUMBERS>,
}
