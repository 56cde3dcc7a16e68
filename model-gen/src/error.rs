//! What can be wrong with a specification or an artifact.

use fixed_dsp::Section;

/// A filter specification that cannot be realised.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// A frequency at or beyond half the sampling rate, or not positive.
    #[error(
        "the {name} of {hz} Hz cannot exist: it must lie between 0 and {nyquist_hz} Hz, half of \
         the sampling rate; change it in [filters] of model.toml, or raise [adc] rate_hz"
    )]
    OutsideNyquist {
        /// Which number.
        name: &'static str,
        /// Its value in Hz.
        hz: f64,
        /// Half of the sampling rate in Hz.
        nyquist_hz: f64,
    },
    /// A harmonic of the mains at or beyond half the sampling rate.
    #[error(
        "with {harmonics} harmonics of {mains_hz} Hz mains the last notch lies at {hz} Hz, but it \
         must lie below {nyquist_hz} Hz, half of the sampling rate: lower [filters] harmonics in \
         model.toml, or raise [adc] rate_hz"
    )]
    Harmonic {
        /// The highest, Hz.
        hz: f64,
        /// Notches beyond the mains frequency's own.
        harmonics: u32,
        /// Mains frequency in Hz.
        mains_hz: f64,
        /// Half of the sampling rate in Hz.
        nyquist_hz: f64,
    },
    /// Lower edge not below the upper one.
    #[error(
        "the band from {low_hz} to {high_hz} Hz is empty: write [filters] band_hz of model.toml \
         as [lower edge, upper edge]"
    )]
    EmptyBand {
        /// Lower edge in Hz.
        low_hz: f64,
        /// Upper edge in Hz.
        high_hz: f64,
    },
    /// An order that has no sensible cascade.
    #[error(
        "a band-pass of order {order} is out of range: [filters] order of model.toml must be \
         between 1 and {highest}"
    )]
    Order {
        /// Asked for.
        order: usize,
        /// Largest that is realised.
        highest: usize,
    },
    /// More sections than a cascade may have.
    #[error(
        "with {harmonics} harmonics and a band-pass of order {order} the filters have {sections} \
         sections, {longest} are the most: lower [filters] harmonics or order in model.toml"
    )]
    Sections {
        /// Harmonics asked for.
        harmonics: u32,
        /// Order asked for.
        order: usize,
        /// How many sections that takes.
        sections: usize,
        /// How many there may be.
        longest: usize,
    },
    /// A notch quality that is not a positive number.
    #[error(
        "a notch of quality {q} cannot be made: [filters] notch_q of model.toml must be large \
         enough for the notch to be narrower than half the sampling rate"
    )]
    NotchQuality {
        /// Asked for.
        q: f64,
    },
    /// Rounding moved a pole out of the unit circle.
    #[error(
        "section {index} is unstable after quantisation ({section:?}): its pole lies closer to \
         the unit circle than 2^-33; raise the lower band edge or lower notch_q in model.toml"
    )]
    Unstable {
        /// Position in the cascade, from 0.
        index: usize,
        /// The quantised section.
        section: Section,
    },
    /// A pole so close to the unit circle that its response hardly ends.
    #[error(
        "the filters remember {samples:.0} samples (pole radius {radius}), more than {longest:.0}: \
         raise the lower edge of [filters] band_hz in model.toml"
    )]
    SlowDecay {
        /// Distance of the slowest pole from the origin.
        radius: f64,
        /// Samples until the response has decayed.
        samples: f64,
        /// Most that are followed.
        longest: f64,
    },
    /// Poles that do not pair up into sections.
    #[error(
        "a band from {low_hz} to {high_hz} Hz has poles too close to the real axis to be told \
         apart: raise the lower edge of [filters] band_hz in model.toml"
    )]
    Poles {
        /// Lower edge in Hz.
        low_hz: f64,
        /// Upper edge in Hz.
        high_hz: f64,
    },
    /// Steps that come faster than samples.
    #[error(
        "{rate_hz} samples a second cannot make {step_rate_hz} steps a second: [adc] rate_hz of \
         model.toml must be at least {step_rate_hz}"
    )]
    BelowStepRate {
        /// Sampling rate in Hz.
        rate_hz: u32,
        /// Rate of the encoder's time steps in Hz.
        step_rate_hz: u32,
    },
    /// Picking every n-th sample with no whole n.
    #[error(
        "literal decimation keeps every n-th sample, but {rate_hz} Hz is no multiple of \
         {step_rate_hz} Hz: write [filters] decimation = \"fir\" in model.toml, which takes any \
         rate, or sample at {nearest_hz} Hz"
    )]
    LiteralRate {
        /// Sampling rate in Hz.
        rate_hz: u32,
        /// Rate of the encoder's time steps in Hz.
        step_rate_hz: u32,
        /// The closest rate that is a multiple.
        nearest_hz: u32,
    },
    /// A ratio of the rates that does not fit 16 bits.
    #[error(
        "{rate_hz} Hz over {step_rate_hz} Hz has no lowest terms below 65536: lower [adc] rate_hz \
         in model.toml"
    )]
    RateTerms {
        /// Sampling rate in Hz.
        rate_hz: u32,
        /// Rate of the encoder's time steps in Hz.
        step_rate_hz: u32,
    },
    /// A resampler that would not leave room for the encoder.
    #[error(
        "at {rate_hz} Hz the resampler has {phases} phases of {taps} taps, and {what} takes \
         {bytes} B, more than {largest}: lower [adc] rate_hz in model.toml to 2144 Hz at most, or \
         choose one that has a larger divisor in common with the steps' rate"
    )]
    ResamplerSize {
        /// What is too large.
        what: &'static str,
        /// Sampling rate in Hz.
        rate_hz: u32,
        /// Phases.
        phases: usize,
        /// Taps of each phase.
        taps: usize,
        /// Its size.
        bytes: usize,
        /// The largest size.
        largest: usize,
    },
    /// A sum of taps that could leave the resampler's accumulator.
    #[error(
        "the taps of the resampler from {rate_hz} Hz add up to {magnitude} / 2^30, which leaves \
         its 64-bit accumulator no room: raise [adc] rate_hz in model.toml"
    )]
    ResamplerAccumulator {
        /// Sampling rate in Hz.
        rate_hz: u32,
        /// Sum of the magnitudes, Q2.30.
        magnitude: u64,
    },
    /// A node of the cascade could leave 32 bits.
    #[error(
        "{node} can reach {gain:.2} times the input: full-scale ADC counts allow less \
         than {limit:.2}; lower [filters] order or raise the lower band edge in model.toml"
    )]
    Overflow {
        /// Which signal of the cascade.
        node: String,
        /// Its worst-case gain (L1 norm).
        gain: f64,
        /// The largest that fits.
        limit: f64,
    },
}

/// An artifact that cannot become integers.
#[derive(Debug, thiserror::Error)]
pub enum ModelGenError {
    /// The artifact itself is unreadable or incomplete.
    #[error(transparent)]
    Artifact(#[from] artifact::ArtifactError),
    /// The filters cannot be realised.
    #[error("the filters for {mains_hz} Hz mains cannot be realised")]
    Filter {
        /// Mains frequency of the cascade.
        mains_hz: f64,
        /// Why.
        #[source]
        source: FilterError,
    },
    /// The ADC's rate cannot be brought to that of the steps.
    #[error("the decimation cannot be realised")]
    Resampler(#[source] FilterError),
    /// A requantisation factor that leaves Q0.32.
    #[error(
        "output {output} of {layer} needs a factor of {factor}, outside of [-0.5, 0.5): the \
         calibrated range is far smaller than the weights can produce; calibrate again on data \
         like the training set"
    )]
    Multiplier {
        /// Layer.
        layer: &'static str,
        /// Output channel.
        output: usize,
        /// Its value.
        factor: f64,
    },
    /// An input scale that does not fit the ADC.
    #[error(
        "one step of a filtered sample is {factor:e} steps of the int8 input: the ADC's scale \
         ([adc] vref_v and gain of model.toml) and the calibrated input range do not belong \
         together"
    )]
    InputScale {
        /// Steps of the input per step of a filtered sample.
        factor: f64,
    },
    /// A sum that could leave 32 bits.
    #[error(
        "an accumulator of {layer} (output {output}) can reach {worst}, beyond 2^31: the bias is \
         far larger than the weights; train with weight decay or drop the dead channel"
    )]
    Accumulator {
        /// Layer.
        layer: &'static str,
        /// Output channel.
        output: usize,
        /// Largest possible magnitude.
        worst: f64,
    },
    /// A padding that does not fit 16 bits.
    #[error(
        "beyond the edges channel {channel} behind conv1 would hold {value:.0}, but at most +-32512 \
         fits: its batch norm's bias is far larger than what the channel was calibrated to reach; \
         train with weight decay, or with [network] padding = \"none\""
    )]
    HiddenPadding {
        /// Channel behind the first convolution.
        channel: usize,
        /// Its value, in steps of the quantised channel.
        value: f64,
    },
    /// A range of the calibration that is not a positive number.
    #[error("the calibrated range of {what} is {value}: run the calibration again")]
    Calibration {
        /// Which one.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A shape that this encoder does not have.
    #[error("{what} is {found}, but this version only builds {expected}")]
    Unsupported {
        /// Which number of the description.
        what: &'static str,
        /// Its value.
        found: String,
        /// What is possible.
        expected: &'static str,
    },
    /// The generated files could not be written.
    #[error("cannot write {path}")]
    Write {
        /// Where.
        path: std::path::PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
}
