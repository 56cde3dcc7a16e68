//! Errors in designing filters and turning an artifact into integers.

use fixed_dsp::MAX_SECTIONS;

use crate::{
    cascade::{FilterSpec, MAX_ORDER},
    headroom::NodeGain,
    resampler::LARGEST_BYTES,
    response::MAX_SAMPLES,
};

/// Reason why a filter cascade or a resampler cannot be realised.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum FilterError {
    #[error(
        "the {0} of {1} Hz cannot exist: it must be between 0 and {limit} Hz, half of \
         the sampling rate; change it in [filters] of model.toml, or raise [adc] rate_hz",
        limit = .2.nyquist_hz()
    )]
    OutsideNyquist(&'static str, f64, FilterSpec),
    #[error(
        "with {} harmonics of {} Hz mains the last notch is at {} Hz, but it \
         must be below {} Hz, half of the sampling rate: lower [filters] harmonics in \
         model.toml, or raise [adc] rate_hz",
        .0.harmonics, .0.mains_hz, .0.highest_notch_hz(), .0.nyquist_hz()
    )]
    Harmonic(FilterSpec),
    #[error(
        "the band from {} to {} Hz is empty: write [filters] band_hz of model.toml \
         as [lower edge, upper edge]",
        .0.band_hz[0], .0.band_hz[1]
    )]
    EmptyBand(FilterSpec),
    #[error(
        "a band-pass of order {} is out of range: [filters] order of model.toml must be \
         between 1 and {MAX_ORDER}",
        .0.order
    )]
    Order(FilterSpec),
    #[error(
        "with {} harmonics and a band-pass of order {} the filters have {} \
         sections, at most {MAX_SECTIONS} are possible: lower [filters] harmonics or order in model.toml",
        .0.harmonics, .0.order, .0.sections()
    )]
    Sections(FilterSpec),
    #[error(
        "a notch of quality {} cannot be made: [filters] notch_q of model.toml must be large \
         enough for the notch to be narrower than half the sampling rate",
        .0.notch_q
    )]
    NotchQuality(FilterSpec),
    /// Rounding the coefficients of a section moved a pole out of the unit circle. The field is the
    /// index of the section, from 0.
    #[error(
        "section {0} is unstable after quantisation: its pole is closer to \
         the unit circle than 2^-33; raise the lower band edge or lower notch_q in model.toml"
    )]
    Unstable(usize),
    /// A pole is so close to the unit circle that the response decays too slowly. The fields are
    /// the pole's radius, and the number of samples until the response has decayed.
    #[error(
        "the response of the filters decays over {1:.0} samples (pole radius {0}), more than \
         {MAX_SAMPLES:.0}: \
         raise the lower edge of [filters] band_hz in model.toml"
    )]
    SlowDecay(f64, f64),
    #[error(
        "a band from {} to {} Hz has poles too close to the real axis to be \
         paired: raise the lower edge of [filters] band_hz in model.toml",
        .0.band_hz[0], .0.band_hz[1]
    )]
    Poles(FilterSpec),
    #[error(
        "{0} samples a second cannot be resampled to {1} steps a second: [adc] rate_hz of \
         model.toml must be at least {1}"
    )]
    BelowStepRate(u32, u32),
    #[error(
        "literal decimation keeps every n-th sample, but {} Hz is not a multiple of \
         {} Hz: write [filters] decimation = \"fir\" in model.toml, which takes any \
         rate, or sample at {} Hz",
        .0, .1, (.0 + .1 / 2) / .1 * .1
    )]
    LiteralRate(u32, u32),
    #[error(
        "the ratio of {0} Hz to {1} Hz in lowest terms is not below 65536: lower [adc] rate_hz \
         in model.toml"
    )]
    RateTerms(u32, u32),
    #[error(
        "at {rate_hz} Hz the resampler has {phases} phases of {taps} taps, and {what} takes \
         {bytes} B, more than {LARGEST_BYTES}: lower [adc] rate_hz in model.toml to 2144 Hz at most, or \
         choose one that has a larger divisor in common with the steps' rate"
    )]
    ResamplerSize { what: String, rate_hz: u32, phases: usize, taps: usize, bytes: usize },
    /// The taps of the resampler could overflow its accumulator. The fields are the sampling rate
    /// in Hz, and the largest sum of a phase's tap magnitudes, Q2.30.
    #[error(
        "the magnitudes of the taps of the resampler from {0} Hz add up to {1} / 2^30, which \
         can overflow its 64-bit accumulator: raise [adc] rate_hz in model.toml"
    )]
    ResamplerAccumulator(u32, u64),
    #[error(
        "{} can reach {:.2} times the input: full-scale ADC counts allow less \
         than {:.2}; lower [filters] order or raise the lower band edge in model.toml",
        .0.node, .0.gain, .1
    )]
    Overflow(NodeGain, f64),
}

/// Reason why an artifact cannot be turned into integers.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum ModelGenError {
    #[error(transparent)]
    Artifact(#[from] artifact::ArtifactError),
    #[error("the filters for {0} Hz mains cannot be realised")]
    Filter(u32, #[source] FilterError),
    #[error("the decimation cannot be realised")]
    Resampler(#[source] FilterError),
    /// A layer's requantisation factor for one of its outputs does not fit Q0.32. The fields are
    /// the name of the layer, the index of the output, and the factor.
    #[error(
        "output {1} of {0} needs a factor of {2}, outside of [-0.5, 0.5): the \
         calibrated range is far smaller than the weights can produce; calibrate again on data \
         like the training set"
    )]
    Multiplier(&'static str, usize, f64),
    #[error(
        "one unit of a filtered sample is {0:e} levels of the int8 input: the ADC's scale \
         ([adc] vref_v and gain of model.toml) and the calibrated input range do not belong \
         together"
    )]
    InputScale(f64),
    /// A layer's accumulator for one of its outputs could overflow 32 bits. The fields are the name
    /// of the layer, the index of the output, and the largest possible magnitude.
    #[error(
        "an accumulator of {0} (output {1}) can reach {2}, beyond 2^31: the bias is \
         far larger than the weights; train with weight decay or drop the dead channel"
    )]
    Accumulator(&'static str, usize, f64),
    #[error(
        "the padding of channel {channel} after conv1 would be {value:.0}, but at most +-32512 \
         fits: its batch norm's bias is far larger than what the channel was calibrated to reach; \
         train with weight decay, or with [network] padding = \"none\""
    )]
    HiddenPadding {
        /// Index from 0 of the padded channel, an output channel of the first convolution.
        channel: usize,
        /// Value of the padding, in levels of the first convolution's quantised output.
        value: f64,
    },
    #[error("the calibrated range of {0} is {1}: run the calibration again")]
    Calibration(&'static str, f64),
    #[error("[filters] mains_hz is {0}, but this version supports only [50, 60]")]
    MainsFrequencies(String),
    #[error("cannot write {path}")]
    Write {
        path: std::path::PathBuf,
        #[source]
        source: std::io::Error,
    },
}
