//! What the encoder makes of a window.

use crate::CodeValues;

/// One code with where it comes from and what went wrong inside its window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code {
    /// Index of the window since the start; wraps.
    pub window: u32,
    /// Index of the ADC sample of the window's first time step, since the start.
    pub first_sample: u64,
    /// How much later the window's last step stands than the ADC sample that completed it,
    /// microseconds; see [`Step::offset_us`](crate::Step::offset_us).
    pub offset_us: u16,
    /// Electrode values of the window that the int8 input clipped (0..=976).
    pub clipped: u16,
    /// Values of the code itself that were clipped (0..=128).
    pub clipped_values: u8,
    /// ADC channels that stood at the rail among the samples of the window's steps, each step with
    /// the three samples before it; bit = channel.
    pub saturated: u64,
    /// True while the filters have not settled since the start: the values are not to be trusted.
    pub settling: bool,
    /// The code itself.
    pub values: CodeValues,
}
