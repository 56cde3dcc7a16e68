//! Counts for the converters that anyone can compute again.

/// Counts of a channel, 0 to 63, at a sample: two waves of 9 to 25 Hz, an offset of its own and noise, all
/// below 2^13. Not EEG: every channel and every sample differs, which is what a comparison needs.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "samples of hours are exact; the waves stay below 2^13"
)]
pub fn count(sample: u64, channel: usize) -> i32 {
    let seconds = sample as f64 / 512.0;
    let channel_number = channel as f64;
    let turns = std::f64::consts::TAU * seconds;
    let wave = 900.0 * (turns * (9.0 + channel_number * 0.07)).sin()
        + 400.0 * (turns * (21.0 + channel_number * 0.11)).cos()
        + 60.0 * (channel_number - 30.0);
    wave as i32 + noise(sample, channel)
}

/// -128 to 127, from a mixed counter (the finaliser of `splitmix64`, Steele, Lea and Flood 2014).
fn noise(sample: u64, channel: usize) -> i32 {
    let seed = sample << 6 | channel as u64 & 63;
    let mut mixed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    mixed = (mixed ^ mixed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    let byte = (mixed ^ mixed >> 31).to_le_bytes()[0];
    i32::from(byte) - 128
}
