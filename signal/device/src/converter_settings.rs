//! Settings of the converters, from the model that this program was built with.

use ads1299::{CHANNELS, Gain, Rate, Settings};

/// Number of converters in the chain.
pub const CHIPS: usize = model::CHANNELS / CHANNELS;

/// Settings of the chain: the model's rate and gain. The driver reads every register back before the
/// chain runs, so the samples of a running chain have this rate, and their counts this scale.
pub const CONVERTER_SETTINGS: Settings<CHIPS> = {
    let (clock, rate) = Rate::of_hz(model::ADC_RATE_HZ as u32)
        .expect("reading the artifact has refused a rate that the converters lack");
    Settings::eeg(clock, rate, GAIN)
};

/// Gain of every channel.
const GAIN: Gain = Gain::of_factor(model::GAIN)
    .expect("reading the artifact has refused a gain that the converters lack");

/// Nanovolts of one count, from the gain in the converters' registers.
#[expect(clippy::cast_possible_truncation, reason = "published as f32")]
pub(crate) const LSB_NV: f32 = (GAIN.lsb_uv() * 1000.0) as f32;

const _: () = {
    assert!(
        model::CHANNELS.is_multiple_of(CHANNELS) && CHIPS >= 1 && CHIPS <= link::MAX_CHIPS,
        "the channels are those of whole converters"
    );
    assert!(
        LSB_NV.to_bits() == model::LSB_NV.to_bits(),
        "filters and codes are scaled for the counts of these converters"
    );
};
