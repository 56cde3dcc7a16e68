//! Reproducible input for the simulated converters.

/// Returns the ADC count of `channel` (0 to 63) at `sample`: the sum of two sine waves between 9 and 28 Hz,
/// an offset that depends on the channel, and noise. The magnitude is below 2^13. The signal does not
/// resemble EEG. All channels and samples differ, so a comparison detects exchanged channels or samples.
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

/// Returns noise from -128 to 127: a hash of sample and channel (the finaliser of `splitmix64`, Steele, Lea
/// and Flood 2014).
fn noise(sample: u64, channel: usize) -> i32 {
    let seed = sample << 6 | channel as u64 & 63;
    let mut mixed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    mixed = (mixed ^ mixed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
    let byte = (mixed ^ mixed >> 31).to_le_bytes()[0];
    i32::from(byte) - 128
}
