//! A window together with its code.

use serde::{Deserialize, Serialize};

use crate::CodeValues;

/// A window as the encoder read it, together with the code that it made of it, now and then; on
/// request. Whoever has the model computes the code again and sees whether the device still does what
/// it was built for. The header's time is that of the window's [`Code`](crate::Code).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Audit<'a> {
    /// First 8 bytes of the SHA-256 over the model.
    pub model_id: [u8; 8],
    /// Index of the window since `Start`, as in its [`Code`](crate::Code).
    pub window: u32,
    /// Planes of the window, the oldest first, in each cell by cell, row-major; `int8`, one byte each.
    #[serde(borrow, serialize_with = "crate::bytes::serialize")]
    pub planes: &'a [u8],
    /// The code, in the format that [`Capabilities::code_format`](crate::Capabilities) names.
    pub values: CodeValues,
}
