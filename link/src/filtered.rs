//! What the filters made of the ADC's samples.

use serde::{Deserialize, Serialize};

use crate::Flags;

/// Steps that a device puts into a [`Filtered`] at most: 61 electrodes take 976 bytes of the body.
pub const FILTERED_STEPS: usize = 4;

/// Bytes of a value in [`Filtered::values`].
pub const VALUE_BYTES: usize = 4;

/// Filtered electrodes at the encoder's rate, before they are quantised, a few steps at a time; on
/// request. The header's time is that of the last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Filtered<'a> {
    /// Index since `Start` of the first step. The next frame's is higher by the steps of this one;
    /// where it is higher still, steps are lost.
    pub first_step: u64,
    /// Electrodes of a step, in the order of [`Capabilities::labels`](crate::Capabilities::labels).
    pub electrodes: u8,
    /// Bits of a value behind the point: `value * lsb_nv / 2^fraction_bits` is nanovolt.
    pub fraction_bits: u8,
    /// What was wrong with the samples of these steps: `ADC_STATUS_BAD`, `LEAD_OFF`, `OVERRUN`,
    /// `SATURATED`, `SETTLING`.
    pub flags: Flags,
    /// Values, step by step, in each electrode by electrode; 32 bits in two's complement, least
    /// significant byte first.
    #[serde(borrow, serialize_with = "crate::bytes::serialize")]
    pub values: &'a [u8],
}

impl Filtered<'_> {
    /// The values in their order; one that is cut is left out.
    pub fn values(&self) -> impl Iterator<Item = i32> {
        let (values, _) = self.values.as_chunks::<VALUE_BYTES>();
        values.iter().map(|&value| i32::from_le_bytes(value))
    }
}
