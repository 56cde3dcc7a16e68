//! One code: what the encoder made of one window.

use serde::{Deserialize, Serialize};

use crate::{CodeValues, Flags};

/// One code: what the encoder made of one window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Code {
    /// First 8 bytes of the SHA-256 over the model; only its decoder can read the values.
    pub model_id: [u8; 8],
    /// Index of the window since `Start`, wraps at 2^32. Goes up by one with every code made,
    /// dropped ones included.
    pub window: u32,
    /// Index since `Start` of the ADC sample that the window's first step was picked from.
    pub first_sample: u64,
    /// What was wrong with, or special about, the window.
    pub flags: Flags,
    /// Values of the window that were clipped on their way into int8; saturates at 65535.
    pub clipped: u16,
    /// Values of the code itself that were clipped, 0 to 128.
    pub clipped_values: u8,
    /// ADC channels that stood at the converter's rail inside the window; bit = channel, in the
    /// order of [`Capabilities::labels`](crate::Capabilities::labels).
    pub saturated: u64,
    /// The code, in the format that [`Capabilities::code_format`](crate::Capabilities) names.
    pub values: CodeValues,
}
