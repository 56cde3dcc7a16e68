//! Spatial filters that the host gives a device, and the band powers that they yield.

use serde::{Deserialize, Serialize};

use crate::flags::Flags;

/// Largest number of spatial filters, and of levels of [`Features`].
pub const MAX_FEATURES: usize = 8;

/// Spatial filters and their band-pass: argument of `SetFeatures`. `docs/features.md` has the
/// computation, and the ranges that a device checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureFilters<'a> {
    /// Identifier of the filters, which every [`Features`] computed with them repeats.
    pub id: u32,
    /// First section of the band-pass.
    pub first: BandPass,
    /// Second section of the band-pass.
    pub second: BandPass,
    /// For each filter, the weight of each electrode of
    /// [`Capabilities::labels`](crate::Capabilities::labels), int8 in two's complement. Serde skips
    /// them, because the frame carries them after the message's fields.
    #[serde(skip)]
    pub weights: &'a [u8],
}

/// Coefficients of a section `y0 = gain (x0 - x2) + a1 y1 + a2 y2` at the step rate, Q32. x is the
/// input and y the output, 0 to 2 steps ago.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BandPass {
    /// Factor of the input term `x0 - x2`.
    pub gain: i64,
    /// Factor of `y1`, the section's output one step earlier.
    pub a1: i64,
    /// Factor of `y2`, the section's output two steps earlier.
    pub a2: i64,
}

/// Band powers of one hop; sent if the host has requested them and has set filters.
///
/// Hop `n` consists of the steps from `n` times [`hop_steps`](crate::Capabilities::hop_steps) on.
/// The header holds the time of the hop's last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Features<'a> {
    /// [`FeatureFilters::id`] of the filters.
    pub id: u32,
    /// Index of the hop since `Start`, wraps at 2^32. Increases by one with every hop, including
    /// hops whose message is dropped.
    pub hop: u32,
    /// Faults and conditions of the hop. [`Flags::SETTLING`] also marks the first second after a
    /// start or new filters, in which the band-pass settles.
    pub flags: Flags,
    /// ADC channels that reached the converter's rail inside the hop; bit n is channel n.
    pub saturated: u64,
    /// Power of each filter's signal, `8 log2(energy) - 80`, rounded and limited to 0..=255: 1 to
    /// [`MAX_FEATURES`] levels. Serde skips them, because the frame carries them after the
    /// message's fields.
    #[serde(skip)]
    pub levels: &'a [u8],
}
