//! Errors of filter design and of turning an artifact into integers.

use fixed_dsp::MAX_SECTIONS;

use crate::cascade::{FilterSpec, MAX_ORDER};
use crate::resampler::LARGEST_BYTES;

/// Why filters or a resampler cannot be realised.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// A frequency, with its name, is not positive, or not below half of the sampling rate.
    #[error(
        "the {0} of {1} Hz cannot exist: it must be between 0 and {limit} Hz, half of \
         the sampling rate; change it in [filters] of model.toml, or raise [adc] rate_hz",
        limit = .2.nyquist_hz()
    )]
    OutsideNyquist(&'static str, f64, FilterSpec),
    /// A harmonic of the mains frequency is not below half of the sampling rate.
    #[error(
        "with {} harmonics of {} Hz mains the last notch is at {} Hz, but it \
         must be below {} Hz, half of the sampling rate: lower [filters] harmonics in \
         model.toml, or raise [adc] rate_hz",
        .0.harmonics, .0.mains_hz, .0.highest_notch_hz(), .0.nyquist_hz()
    )]
    Harmonic(FilterSpec),
    /// The lower edge of the band is not below the upper one.
    #[error(
        "the band from {} to {} Hz is empty: write [filters] band_hz of model.toml \
         as [lower edge, upper edge]",
        .0.band_hz[0], .0.band_hz[1]
    )]
    EmptyBand(FilterSpec),
    /// The order of the band-pass is out of range.
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
    /// Rounding the coefficients of a section moved a pole out of the unit circle; the sections
    /// count from 0.
    #[error(
        "section {0} is unstable after quantisation: its pole is closer to \
         the unit circle than 2^-33; raise the lower band edge or lower notch_q in model.toml"
    )]
    Unstable(usize),
    /// A pole is so close to the unit circle that the response decays too slowly.
    #[error(
        "the response of the filters decays over {samples:.0} samples (pole radius {radius}), more than \
         {longest:.0}: \
         raise the lower edge of [filters] band_hz in model.toml"
    )]
    SlowDecay {
        /// Distance of the slowest pole from the origin.
        radius: f64,
        /// Samples until the response has decayed.
        samples: f64,
        /// Longest supported response in samples.
        longest: f64,
    },
    /// The poles cannot be paired into sections.
    #[error(
        "a band from {} to {} Hz has poles too close to the real axis to be \
         paired: raise the lower edge of [filters] band_hz in model.toml",
        .0.band_hz[0], .0.band_hz[1]
    )]
    Poles(FilterSpec),
    /// The step rate is higher than the sampling rate.
    #[error(
        "{adc} samples a second cannot be resampled to {step} steps a second: [adc] rate_hz of \
         model.toml must be at least {step}",
        adc = .0.adc, step = .0.step
    )]
    BelowStepRate(RatesHz),
    /// Literal decimation was requested at a sampling rate that is not a multiple of the step rate.
    #[error(
        "literal decimation keeps every n-th sample, but {} Hz is not a multiple of \
         {} Hz: write [filters] decimation = \"fir\" in model.toml, which takes any \
         rate, or sample at {} Hz",
        .0.adc, .0.step, .0.nearest_multiple()
    )]
    LiteralRate(RatesHz),
    /// The numerator of sampling rate / step rate, in lowest terms, does not fit 16 bits.
    #[error(
        "the ratio of {} Hz to {} Hz in lowest terms is not below 65536: lower [adc] rate_hz \
         in model.toml",
        .0.adc, .0.step
    )]
    RateTerms(RatesHz),
    /// The delay line or the table of taps of the resampler takes more memory than permitted.
    #[error(
        "at {rate_hz} Hz the resampler has {phases} phases of {taps} taps, and {what} takes \
         {bytes} B, more than {LARGEST_BYTES}: lower [adc] rate_hz in model.toml to 2144 Hz at most, or \
         choose one that has a larger divisor in common with the steps' rate"
    )]
    ResamplerSize {
        /// Name of the part that is too large.
        what: String,
        /// Sampling rate of the ADC, Hz.
        rate_hz: u32,
        /// Number of phases of the polyphase filter.
        phases: usize,
        /// Number of taps of each phase.
        taps: usize,
        /// Size of the part in bytes.
        bytes: usize,
    },
    /// The taps could overflow the resampler's accumulator.
    #[error(
        "the magnitudes of the taps of the resampler from {rate_hz} Hz add up to {magnitude} / 2^30, which \
         can overflow its 64-bit accumulator: raise [adc] rate_hz in model.toml"
    )]
    ResamplerAccumulator {
        /// Sampling rate of the ADC, Hz.
        rate_hz: u32,
        /// Largest sum of the tap magnitudes of a phase, Q2.30.
        magnitude: u64,
    },
    /// A node of the cascade could overflow 32 bits.
    #[error(
        "{node} can reach {gain:.2} times the input: full-scale ADC counts allow less \
         than {limit:.2}; lower [filters] order or raise the lower band edge in model.toml"
    )]
    Overflow {
        /// Name of the signal, for example "output of section 3".
        node: String,
        /// L1 norm of the impulse response from the input to the node: its worst-case gain.
        gain: f64,
        /// Upper limit of the gain.
        limit: f64,
    },
}

/// Sampling rate of the ADC and rate of the encoder's time steps, Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RatesHz {
    pub(crate) adc: u32,
    pub(crate) step: u32,
}

impl RatesHz {
    /// Returns the multiple of the step rate that is nearest to the sampling rate.
    fn nearest_multiple(self) -> u32 {
        (self.adc + self.step / 2) / self.step * self.step
    }
}

/// Why an artifact cannot be turned into integers.
#[derive(Debug, thiserror::Error)]
pub enum ModelGenError {
    /// The artifact is unreadable or invalid.
    #[error(transparent)]
    Artifact(#[from] artifact::ArtifactError),
    /// The filters for a mains frequency cannot be realised.
    #[error("the filters for {mains_hz} Hz mains cannot be realised")]
    Filter {
        /// Mains frequency of the cascade, Hz.
        mains_hz: f64,
        /// Error from the filter design.
        #[source]
        source: FilterError,
    },
    /// The resampler cannot be realised.
    #[error("the decimation cannot be realised")]
    Resampler(#[source] FilterError),
    /// A requantisation factor does not fit Q0.32.
    #[error(
        "output {output} of {layer} needs a factor of {factor}, outside of [-0.5, 0.5): the \
         calibrated range is far smaller than the weights can produce; calibrate again on data \
         like the training set"
    )]
    Multiplier {
        /// Name of the layer, for example "conv1".
        layer: &'static str,
        /// Output channel, from 0.
        output: usize,
        /// Requantisation factor that this output needs.
        factor: f64,
    },
    /// The factor from filtered samples to levels of the int8 input is too small or too large for
    /// Q0.32.
    #[error(
        "one unit of a filtered sample is {0:e} levels of the int8 input: the ADC's scale \
         ([adc] vref_v and gain of model.toml) and the calibrated input range do not belong \
         together"
    )]
    InputScale(f64),
    /// An accumulator could overflow 32 bits.
    #[error(
        "an accumulator of {layer} (output {output}) can reach {worst}, beyond 2^31: the bias is \
         far larger than the weights; train with weight decay or drop the dead channel"
    )]
    Accumulator {
        /// Name of the layer, for example "conv1".
        layer: &'static str,
        /// Output channel, from 0.
        output: usize,
        /// Largest possible magnitude.
        worst: f64,
    },
    /// A padding value of the second convolution is beyond +-32512.
    #[error(
        "the padding of channel {channel} after conv1 would be {value:.0}, but at most +-32512 \
         fits: its batch norm's bias is far larger than what the channel was calibrated to reach; \
         train with weight decay, or with [network] padding = \"none\""
    )]
    HiddenPadding {
        /// Output channel of the first convolution, from 0.
        channel: usize,
        /// Value of the padding, in levels of the quantised channel.
        value: f64,
    },
    /// A calibrated range is not a positive, finite number.
    #[error("the calibrated range of {what} is {value}: run the calibration again")]
    Calibration {
        /// Name of the tensor in the calibration.
        what: &'static str,
        /// Calibrated range, as read.
        value: f64,
    },
    /// A number of the description is not supported by this version.
    #[error("{what} is {found}, but this version supports only {expected}")]
    Unsupported {
        /// Name of the field in `model.toml`.
        what: &'static str,
        /// Value of the field.
        found: String,
        /// Supported values.
        expected: &'static str,
    },
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
