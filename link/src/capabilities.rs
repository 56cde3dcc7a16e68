//! What the device measures and how its codes are to be read.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::{CODE_LEN, CodeFormat};

/// Longest [`Capabilities::labels`], bytes: 64 labels of 7 characters with a blank after each.
pub const MAX_LABELS_BYTES: usize = 512;

/// What the device measures and how its codes are to be read; follows every `Hello`.
///
/// It does not change until the next `Hello`, except for `mains_hz` and `filters`, which a `Start`
/// with other mains changes; the device then sends it again before the `Ack`.
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
    /// Volts per count from the registers read back, in nanovolt (22.351742 for an ADS1299 at
    /// gain 24 and 4.5 V).
    pub lsb_nv: f32,
    /// Mains that the running notch removes, 50 or 60 Hz.
    pub mains_hz: u8,
    /// Delay of the filter chain in its pass band, microseconds: a code stamped `t` shows what
    /// the scalp did at `t - group_delay_us`.
    pub group_delay_us: u32,
    /// Electrode labels, blank-separated, in the order of the montage (ADC channel order, the
    /// same as the row-major order of the scalp grid's cells). At most [`MAX_LABELS_BYTES`].
    pub labels: &'a str,
    /// The filter chain in words. At most [`MAX_TEXT_BYTES`](crate::MAX_TEXT_BYTES).
    pub filters: &'a str,
    /// Format of the codes; it never differs from one code to the next.
    pub code_format: CodeFormat,
    /// Scale of each code value: `z = (step - code_zero_point) * code_scale`, with the
    /// [steps](crate::CodeValues::steps) of the code. Positive and finite.
    pub code_scale: Vec<f32, CODE_LEN>,
    /// Step that means `z = 0`; 0 in the formats other than [`CodeFormat::Int8`].
    pub code_zero_point: Vec<i8, CODE_LEN>,
}
