//! Errors of filter design and of turning an artifact into integers.

use fixed_dsp::Section;

/// Why filters or a resampler cannot be realised.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// A frequency is not positive, or not below half of the sampling rate.
    #[error(
        "the {name} of {hz} Hz cannot exist: it must be between 0 and {nyquist_hz} Hz, half of \
         the sampling rate; change it in [filters] of model.toml, or raise [adc] rate_hz"
    )]
    OutsideNyquist {
        /// Name of the frequency in the specification.
        name: &'static str,
        /// Requested frequency, Hz.
        hz: f64,
        /// Half of the sampling rate, Hz: the upper limit of every frequency.
        nyquist_hz: f64,
    },
    /// A harmonic of the mains frequency is not below half of the sampling rate.
    #[error(
        "with {harmonics} harmonics of {mains_hz} Hz mains the last notch is at {hz} Hz, but it \
         must be below {nyquist_hz} Hz, half of the sampling rate: lower [filters] harmonics in \
         model.toml, or raise [adc] rate_hz"
    )]
    Harmonic {
        /// Frequency of the highest notch, Hz.
        hz: f64,
        /// Requested number of harmonics.
        harmonics: u32,
        /// Mains frequency of these filters, Hz.
        mains_hz: f64,
        /// Half of the sampling rate, Hz: the upper limit of every frequency.
        nyquist_hz: f64,
    },
    /// The lower edge of the band is not below the upper one.
    #[error(
        "the band from {low_hz} to {high_hz} Hz is empty: write [filters] band_hz of model.toml \
         as [lower edge, upper edge]"
    )]
    EmptyBand {
        /// Lower edge of the requested band, Hz.
        low_hz: f64,
        /// Upper edge of the requested band, Hz.
        high_hz: f64,
    },
    /// The order of the band-pass is out of range.
    #[error(
        "a band-pass of order {order} is out of range: [filters] order of model.toml must be \
         between 1 and {highest}"
    )]
    Order {
        /// Requested order of the band-pass per edge.
        order: usize,
        /// Largest supported order.
        highest: usize,
    },
    /// The filters need more sections than a cascade can have.
    #[error(
        "with {harmonics} harmonics and a band-pass of order {order} the filters have {sections} \
         sections, at most {longest} are possible: lower [filters] harmonics or order in model.toml"
    )]
    Sections {
        /// Requested number of harmonics.
        harmonics: u32,
        /// Requested order of the band-pass per edge.
        order: usize,
        /// Number of sections that these filters need.
        sections: usize,
        /// Largest possible number of sections.
        longest: usize,
    },
    /// The quality factor of the notch is not positive, or so low that the notch is wider than half of
    /// the sampling rate.
    #[error(
        "a notch of quality {q} cannot be made: [filters] notch_q of model.toml must be large \
         enough for the notch to be narrower than half the sampling rate"
    )]
    NotchQuality {
        /// Requested quality factor.
        q: f64,
    },
    /// Rounding the coefficients moved a pole out of the unit circle.
    #[error(
        "section {index} is unstable after quantisation: its pole is closer to \
         the unit circle than 2^-33; raise the lower band edge or lower notch_q in model.toml"
    )]
    Unstable {
        /// Position in the cascade, from 0.
        index: usize,
        /// Section after quantisation.
        section: Section,
    },
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
        "a band from {low_hz} to {high_hz} Hz has poles too close to the real axis to be \
         paired: raise the lower edge of [filters] band_hz in model.toml"
    )]
    Poles {
        /// Lower edge of the requested band, Hz.
        low_hz: f64,
        /// Upper edge of the requested band, Hz.
        high_hz: f64,
    },
    /// The step rate is higher than the sampling rate.
    #[error(
        "{rate_hz} samples a second cannot be resampled to {step_rate_hz} steps a second: [adc] rate_hz of \
         model.toml must be at least {step_rate_hz}"
    )]
    BelowStepRate {
        /// Sampling rate of the ADC, Hz.
        rate_hz: u32,
        /// Rate of the encoder's time steps in Hz.
        step_rate_hz: u32,
    },
    /// Literal decimation was requested at a sampling rate that is not a multiple of the step rate.
    #[error(
        "literal decimation keeps every n-th sample, but {rate_hz} Hz is not a multiple of \
         {step_rate_hz} Hz: write [filters] decimation = \"fir\" in model.toml, which takes any \
         rate, or sample at {nearest_hz} Hz"
    )]
    LiteralRate {
        /// Sampling rate of the ADC, Hz.
        rate_hz: u32,
        /// Rate of the encoder's time steps in Hz.
        step_rate_hz: u32,
        /// Nearest multiple of the step rate in Hz.
        nearest_hz: u32,
    },
    /// The numerator of sampling rate / step rate, in lowest terms, does not fit 16 bits.
    #[error(
        "the ratio of {rate_hz} Hz to {step_rate_hz} Hz in lowest terms is not below 65536: lower [adc] rate_hz \
         in model.toml"
    )]
    RateTerms {
        /// Sampling rate of the ADC, Hz.
        rate_hz: u32,
        /// Rate of the encoder's time steps in Hz.
        step_rate_hz: u32,
    },
    /// The delay line or the table of taps of the resampler takes more memory than permitted.
    #[error(
        "at {rate_hz} Hz the resampler has {phases} phases of {taps} taps, and {what} takes \
         {bytes} B, more than {largest}: lower [adc] rate_hz in model.toml to 2144 Hz at most, or \
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
        /// Largest permitted size in bytes.
        largest: usize,
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
    /// The factor from filtered samples to levels of the int8 input is too small or too large for Q0.32.
    #[error(
        "one unit of a filtered sample is {factor:e} levels of the int8 input: the ADC's scale \
         ([adc] vref_v and gain of model.toml) and the calibrated input range do not belong \
         together"
    )]
    InputScale {
        /// Levels of the input for one unit of a filtered sample.
        factor: f64,
    },
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
