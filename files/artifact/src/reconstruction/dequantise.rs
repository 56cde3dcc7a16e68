//! Dequantises the values of codes.

/// Returns the value `z = (level - zero_point) * scale` of a level of a code, the input of the
/// decoder network. |level| is below 2^16.
#[expect(
    clippy::cast_precision_loss,
    reason = "the difference has 17 bits at most"
)]
pub fn dequantise(level: i32, scale: f32, zero_point: i8) -> f32 {
    (level - i32::from(zero_point)) as f32 * scale
}

/// Returns the smallest and the largest value `z` to which levels from `least` to `greatest`
/// dequantise, over all places of a code; zeros for a code without values.
pub fn code_range([least, greatest]: [i32; 2], scale: &[f32], zero_point: &[i8]) -> [f32; 2] {
    if scale.is_empty() {
        return [0.0; 2];
    }
    let ends = |level| {
        let numbers = scale.iter().zip(zero_point);
        numbers.map(move |(scale, zero_point)| dequantise(level, *scale, *zero_point))
    };
    [
        ends(least).fold(f32::INFINITY, f32::min),
        ends(greatest).fold(f32::NEG_INFINITY, f32::max),
    ]
}
