//! Dequantises the values of codes.

/// Returns the value `z = (level - zero_point) * scale` of a level of a code, the input of the decoder
/// network. |level| is below 2^16.
#[expect(
    clippy::cast_precision_loss,
    reason = "the difference has 17 bits at most"
)]
pub fn dequantise(level: i32, scale: f32, zero_point: i8) -> f32 {
    (level - i32::from(zero_point)) as f32 * scale
}
