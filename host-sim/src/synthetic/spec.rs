//! Parameters of synthetic EEG, and the errors for invalid parameters.

use recordings::virtual_adc::CHANNELS;
use thiserror::Error;

/// Parameters of synthetic EEG. An amplitude of 0 switches its component off.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntheticSpec {
    /// Seed of every random stream: equal specs yield equal counts.
    pub seed: u64,
    /// Samples per second, Hz, 128..=16,000.
    pub rate_hz: u32,
    /// Microvolts per count of the ADC, > 0.
    pub lsb_uv: f64,
    /// Labels of the electrodes in the 10-5 system; the first one is on ADC channel 0, and so on.
    pub electrodes: Vec<String>,
    /// Amplitude of the background, uV RMS within 0.5-60 Hz over the electrodes of the 10-20
    /// system. If it is above 0, each electrode also has 1 uV RMS of white noise.
    pub background_uv: f64,
    /// Amplitude of the alpha rhythm during a burst, uV RMS at that electrode over the back of the
    /// head where it is largest.
    pub alpha_uv: f64,
    /// Amplitude of the sensorimotor rhythm of each hand area at rest, uV RMS at C3 and C4. No hand
    /// moves until [`Generator::move_hand`](super::Generator::move_hand).
    pub mu_uv: f64,
    /// Mains frequency, Hz, > 0 and below half the rate.
    pub mains_hz: u32,
    /// Mean peak amplitude of mains interference, uV. A random factor of 0.5 to 1.5 scales it at
    /// each electrode.
    pub mains_uv: f64,
    /// Largest absolute value of an electrode's offset, mV. Each electrode has a random offset of
    /// either sign.
    pub offset_mv: f64,
    /// Slow drift on top of the offset, uV RMS.
    pub drift_uv: f64,
    /// Adds a blink of 150 to 300 uV at Fpz every 2 to 7 s.
    pub blinks: bool,
    /// Drives a random electrode to the ADC's rail for 0.2 to 1.5 s, every 5 to 20 s.
    pub rails: bool,
}

impl SyntheticSpec {
    /// Returns the parameters of EEG recorded at rest by the model's ADC: 50 Hz mains, blinks, no
    /// rails.
    ///
    /// Spectral slope and spatial correlation are close to those of real EEG, see
    /// [`synthetic`](crate::synthetic). Including alpha and blinks, the electrodes' RMS values are
    /// 22 to 42 uV within 0.5-60 Hz (measured with seeds 1, 2, 3 and 7 over 120 s).
    pub fn new(seed: u64, electrodes: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self {
            seed,
            rate_hz: model::ADC_RATE_HZ.into(),
            lsb_uv: f64::from(model::LSB_NV) / 1_000.0,
            electrodes: electrodes.into_iter().map(Into::into).collect(),
            background_uv: 25.0,
            alpha_uv: 20.0,
            mu_uv: 0.0,
            mains_hz: 50,
            mains_uv: 20.0,
            offset_mv: 20.0,
            drift_uv: 100.0,
            blinks: true,
            rails: false,
        }
    }
}

/// Why the generator refuses a spec.
#[derive(Debug, Error, PartialEq)]
pub enum SyntheticError {
    /// A label without a position in the 10-5 system; holds the label.
    #[error(
        "{0} is no electrode of the 10-20, 10-10 or 10-5 system, so it has no place on the scalp"
    )]
    UnknownElectrode(String),
    /// More electrodes than the ADC has channels (64); holds the number of electrodes.
    #[error("{0} electrodes do not fit the ADC's {CHANNELS} channels")]
    TooManyElectrodes(usize),
    /// Rate or mains frequency outside the generator's range.
    #[error(
        "{rate_hz} Hz with {mains_hz} Hz mains cannot be synthesised; give 128..=16000 Hz and a mains frequency below half of it"
    )]
    Rate {
        /// Sample rate in the spec, Hz.
        rate_hz: u32,
        /// Mains frequency in the spec, Hz.
        mains_hz: u32,
    },
    /// The number of microvolts per count is not above 0; holds that number.
    #[error("a count of {0} uV is no scale; write a number above 0")]
    Scale(f64),
    /// An amplitude that is negative, infinite or not a number.
    #[error("{name} is {value}; write an amplitude of 0 or more")]
    Amplitude {
        /// Name of the field in [`SyntheticSpec`].
        name: &'static str,
        /// Amplitude that the spec has in this field.
        value: f64,
    },
}
