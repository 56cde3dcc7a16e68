//! Errors of designing filters and of turning an artifact into integers.

use fixed_dsp::MAX_SECTIONS;

use crate::{
    cascade::{FilterSpec, MAX_ORDER},
    headroom::NodeGain,
    resampler::LARGEST_BYTES,
    response::MAX_SAMPLES,
};

/// Reason why a filter cascade or a resampler cannot be realised.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// A frequency is not positive, or not below half of the sampling rate. The fields are its
    /// name, its value in Hz, and the specification.
    #[error(
        "the {0} of {1} Hz cannot exist: it must be between 0 and {limit} Hz, half of \
         the sampling rate; change it in [filters] of model.toml, or raise [adc] rate_hz",
        limit = .2.nyquist_hz()
    )]
    OutsideNyquist(&'static str, f64, FilterSpec),
    /// The highest notch, at a harmonic of the mains frequency, is not below half of the sampling
    /// rate.
    #[error(
        "with {} harmonics of {} Hz mains the last notch is at {} Hz, but it \
         must be below {} Hz, half of the sampling rate: lower [filters] harmonics in \
         model.toml, or raise [adc] rate_hz",
        .0.harmonics, .0.mains_hz, .0.highest_notch_hz(), .0.nyquist_hz()
    )]
    Harmonic(FilterSpec),
    /// The band-pass's lower edge is not below its upper edge.
    #[error(
        "the band from {} to {} Hz is empty: write [filters] band_hz of model.toml \
         as [lower edge, upper edge]",
        .0.band_hz[0], .0.band_hz[1]
    )]
    EmptyBand(FilterSpec),
    /// The order of the band-pass is 0 or too high for quantised sections.
    #[error(
        "a band-pass of order {} is out of range: [filters] order of model.toml must be \
         between 1 and {MAX_ORDER}",
        .0.order
    )]
    Order(FilterSpec),
    /// The filters need more sections than a cascade can have.
    #[error(
        "with {} harmonics and a band-pass of order {} the filters have {} \
         sections, at most {MAX_SECTIONS} are possible: lower [filters] harmonics or order in model.toml",
        .0.harmonics, .0.order, .0.sections()
    )]
    Sections(FilterSpec),
    /// The quality factor of the notch is not positive, or so low that the notch is wider than half
    /// of the sampling rate.
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
    /// The poles cannot be paired into sections, because some are too close to the real axis.
    #[error(
        "a band from {} to {} Hz has poles too close to the real axis to be \
         paired: raise the lower edge of [filters] band_hz in model.toml",
        .0.band_hz[0], .0.band_hz[1]
    )]
    Poles(FilterSpec),
    /// The step rate exceeds the sampling rate. The fields are sampling rate and step rate, Hz.
    #[error(
        "{0} samples a second cannot be resampled to {1} steps a second: [adc] rate_hz of \
         model.toml must be at least {1}"
    )]
    BelowStepRate(u32, u32),
    /// Literal decimation was requested at a sampling rate that is no multiple of the step rate.
    /// The fields are sampling rate and step rate, Hz.
    #[error(
        "literal decimation keeps every n-th sample, but {} Hz is not a multiple of \
         {} Hz: write [filters] decimation = \"fir\" in model.toml, which takes any \
         rate, or sample at {} Hz",
        .0, .1, (.0 + .1 / 2) / .1 * .1
    )]
    LiteralRate(u32, u32),
    /// The ratio of sampling rate to step rate, in lowest terms, has a numerator beyond 16 bits.
    /// The fields are sampling rate and step rate, Hz.
    #[error(
        "the ratio of {0} Hz to {1} Hz in lowest terms is not below 65536: lower [adc] rate_hz \
         in model.toml"
    )]
    RateTerms(u32, u32),
    /// The resampler's delay line or its table of taps takes more memory than permitted.
    #[error(
        "at {rate_hz} Hz the resampler has {phases} phases of {taps} taps, and {what} takes \
         {bytes} B, more than {LARGEST_BYTES}: lower [adc] rate_hz in model.toml to 2144 Hz at most, or \
         choose one that has a larger divisor in common with the steps' rate"
    )]
    ResamplerSize {
        /// Name of the part of the resampler that is too large.
        what: String,
        /// Sampling rate of the ADC, Hz.
        rate_hz: u32,
        /// Number of phases of the resampler.
        phases: usize,
        /// Number of taps of each phase.
        taps: usize,
        /// Size of the part named in `what`, bytes.
        bytes: usize,
    },
    /// The taps of the resampler could overflow its accumulator. The fields are the sampling rate
    /// in Hz, and the largest sum of a phase's tap magnitudes, Q2.30.
    #[error(
        "the magnitudes of the taps of the resampler from {0} Hz add up to {1} / 2^30, which \
         can overflow its 64-bit accumulator: raise [adc] rate_hz in model.toml"
    )]
    ResamplerAccumulator(u32, u64),
    /// A node of the cascade could overflow 32 bits. The fields are the node with its gain, and the
    /// limit.
    #[error(
        "{} can reach {:.2} times the input: full-scale ADC counts allow less \
         than {:.2}; lower [filters] order or raise the lower band edge in model.toml",
        .0.node, .0.gain, .1
    )]
    Overflow(NodeGain, f64),
}

/// Reason why an artifact cannot be turned into integers.
#[derive(Debug, thiserror::Error)]
pub enum ModelGenError {
    /// The artifact is unreadable or invalid.
    #[error(transparent)]
    Artifact(#[from] artifact::ArtifactError),
    /// The filters for one mains frequency cannot be realised. The fields are the frequency in Hz,
    /// and the reason.
    #[error("the filters for {0} Hz mains cannot be realised")]
    Filter(u32, #[source] FilterError),
    /// The resampler from the ADC's rate to the step rate cannot be realised.
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
    /// The factor from filtered samples to levels of the int8 input does not fit Q0.32. The field
    /// is the factor.
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
    /// A padding value of the second convolution is beyond +-32512, the limit of its kernels.
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
    /// A range from calibration is not a positive, finite number. The fields are the name of the
    /// range's tensor, and the range.
    #[error("the calibrated range of {0} is {1}: run the calibration again")]
    Calibration(&'static str, f64),
    /// The description states other mains frequencies than this version supports. The field is the
    /// list that it states.
    #[error("[filters] mains_hz is {0}, but this version supports only [50, 60]")]
    MainsFrequencies(String),
    /// A generated file could not be written.
    #[error("cannot write {path}")]
    Write {
        /// Path of the file that could not be written.
        path: std::path::PathBuf,
        /// Error from the operating system.
        #[source]
        source: std::io::Error,
    },
}
