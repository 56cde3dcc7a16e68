//! The integers of a model for the device: what the generated source of the crate `model` contains.

use artifact::{Artifact, Decimation, Description, Filters, List, ModelId, SubstitutionTable};
use fixed_dsp::Section;

use crate::{
    cascade::{FilterSpec, cascade},
    chain::Chain,
    error::{FilterError, ModelGenError},
    headroom::{self, GUARD_BITS, NodeGain},
    integer_model::IntegerModel,
    layer::to_i32,
    packed::PackedIntegers,
    quantise::quantise,
    resampler::{CUTOFF_HZ, ResamplerTable},
};

/// Mains frequencies for which filters are generated, Hz; the device selects one of them at start.
pub const MAINS_HZ: [u32; 2] = [50, 60];

/// Frequency for which the filters' group delay is stated, Hz: the middle of the alpha band.
const DELAY_AT_HZ: f64 = 10.0;

/// Level at which the filters count as settled after a step at the input, as a fraction of the
/// step: 1 uV for an electrode offset of 10 mV.
const SETTLED: f64 = 1e-4;

/// Smallest permitted factor from filtered samples to input levels, Q0.32. Rounding to Q0.32
/// changes a factor by at most half a unit, so a permitted factor by at most 2^-9 of its value.
const MIN_INPUT_MULTIPLIER: i32 = 256;

/// The filters for one mains frequency, and their delays.
#[derive(Clone, Debug)]
pub struct MainsFilter {
    /// Mains frequency that the notch removes, Hz.
    pub mains_hz: u32,
    /// Sections of the quantised cascade, in signal order.
    pub sections: Vec<Section>,
    /// Worst-case gain from the input to every node of the cascade, in signal order.
    pub gains: Vec<NodeGain>,
    /// Group delay of cascade and resampler together at 10 Hz, microseconds.
    pub group_delay_us: u32,
    /// Time from the middle of a window, measured at the electrodes, to the time stamp of the
    /// window's code, microseconds.
    pub scalp_delay_us: u32,
    /// Number of ADC samples after a step at the input until the resampler's output has decayed to
    /// 1e-4 of the step.
    pub settling_samples: u32,
    /// Text that describes the filters; recordings store it in their `prefiltering` fields.
    pub description: String,
}

/// A model made from an artifact, in the integers with which the device computes.
#[derive(Clone, Debug)]
pub struct DeviceModel {
    /// Id of the artifact; the device sends it with every code.
    pub id: ModelId,
    /// Id of the artifact's network. Artifacts that differ only in packed model and table of
    /// substitutions have the same network id.
    pub network_id: ModelId,
    /// Contents of the artifact's `model.toml`.
    pub description: Description,
    /// Filters for each frequency of [`MAINS_HZ`], in the same order.
    pub filters: Vec<MainsFilter>,
    /// Resampler from the ADC's rate to the step rate, applied after the filters. The same table
    /// serves both mains frequencies.
    pub resampler: ResamplerTable,
    /// Factor, Q0.32, that turns a filtered sample (counts, Q27.5) into a level of the int8 input.
    pub input_multiplier: i32,
    /// Quantised encoder, with the weights in the layout of the artifact.
    pub integers: IntegerModel,
    /// The packed model; `None` if the artifact has none.
    pub packed: Option<PackedIntegers>,
    /// The table of substitutions; `None` if the artifact has none.
    pub substitution: Option<SubstitutionTable>,
}

impl DeviceModel {
    /// Turns an artifact into integers and proves that every value stays within its range.
    ///
    /// # Errors
    /// If the filters cannot be realised, a range does not fit, or this version does not support a
    /// feature of the artifact.
    pub fn new(artifact: &Artifact) -> Result<Self, ModelGenError> {
        let description = artifact.description.clone();
        let mains_hz = &description.filters.mains_hz;
        if !MAINS_HZ.iter().all(|hz| mains_hz.contains(hz)) {
            return Err(ModelGenError::MainsFrequencies(List(mains_hz).to_string()));
        }
        let integers = quantise(artifact)?;
        let resampler = resampler_table(&description)?;
        let filters = MAINS_HZ
            .into_iter()
            .map(|mains_hz| mains_filter(&description, &resampler, mains_hz))
            .collect::<Result<_, _>>()?;
        let input_multiplier = input_multiplier(&description, &integers)?;
        Ok(Self {
            id: artifact.id,
            network_id: artifact.network_id()?,
            description,
            filters,
            resampler,
            input_multiplier,
            integers,
            packed: artifact
                .packed
                .as_ref()
                .map(|packed| PackedIntegers::new(packed, &artifact.description))
                .transpose()?,
            substitution: artifact.substitution.clone(),
        })
    }

    /// Returns the size of one ADC count, nV.
    #[expect(clippy::cast_possible_truncation, reason = "published as f32")]
    pub fn lsb_nv(&self) -> f32 {
        (self.description.adc.lsb_uv() * 1_000.0) as f32
    }

    /// Returns the time from the middle of a window to its last step, microseconds.
    pub fn window_centre_us(&self) -> u32 {
        window_centre_us(&self.description)
    }
}

/// Returns the Q0.32 factor from filtered samples (counts, Q27.5) to levels of the int8 input.
pub(crate) fn input_multiplier(
    description: &Description,
    integers: &IntegerModel,
) -> Result<i32, ModelGenError> {
    let unit_uv = description.adc.lsb_uv() / f64::from(1_u32 << GUARD_BITS);
    let factor = unit_uv / f64::from(integers.input_scale_uv);
    to_i32(factor * 4_294_967_296.0)
        .filter(|multiplier| *multiplier >= MIN_INPUT_MULTIPLIER)
        .ok_or(ModelGenError::InputScale(factor))
}

/// Designs the cascade of an artifact's filters for one mains frequency and one ADC rate.
///
/// # Errors
/// If the filters cannot be realised, as in [`cascade()`].
pub fn filter_cascade(
    filters: &Filters,
    rate_hz: u32,
    mains_hz: u32,
) -> Result<Vec<Section>, FilterError> {
    cascade(&FilterSpec {
        rate_hz: rate_hz.into(),
        mains_hz: mains_hz.into(),
        notch_q: filters.notch_q,
        harmonics: filters.harmonics,
        band_hz: filters.band_hz,
        order: usize::try_from(filters.order).unwrap_or(usize::MAX),
    })
}

/// Returns how long the output of filters and resampler takes to fall below 1e-4 of a step at the
/// input for good, in ADC samples. During this time the device sets its flag `settling`.
///
/// # Errors
/// If the filters cannot be realised.
pub fn settling_samples(description: &Description, mains_hz: u32) -> Result<usize, ModelGenError> {
    let resampler = resampler_table(description)?;
    let filter = mains_filter(description, &resampler, mains_hz)?;
    Ok(filter.settling_samples as usize)
}

/// Returns the group delay of filters and resampler together at 10 Hz, microseconds.
///
/// # Errors
/// If the filters cannot be realised.
pub fn group_delay_us(description: &Description, mains_hz: u32) -> Result<u32, ModelGenError> {
    let resampler = resampler_table(description)?;
    Ok(mains_filter(description, &resampler, mains_hz)?.group_delay_us)
}

fn resampler_table(description: &Description) -> Result<ResamplerTable, ModelGenError> {
    ResamplerTable::new(
        description.filters.decimation,
        description.adc.rate_hz,
        description.window.rate_hz,
        description.montage.electrodes.len(),
    )
    .map_err(ModelGenError::Resampler)
}

fn mains_filter(
    description: &Description,
    resampler: &ResamplerTable,
    mains_hz: u32,
) -> Result<MainsFilter, ModelGenError> {
    realised_filter(description, resampler, mains_hz)
        .map_err(|source| ModelGenError::Filter(mains_hz, source))
}

fn realised_filter(
    description: &Description,
    resampler: &ResamplerTable,
    mains_hz: u32,
) -> Result<MainsFilter, FilterError> {
    let (filters, rate_hz) = (&description.filters, description.adc.rate_hz);
    let sections = filter_cascade(filters, rate_hz, mains_hz)?;
    let chain = Chain { sections: &sections, resampler, rate_hz };
    let mut gains = headroom::prove_cascade(&sections)?;
    gains.push(headroom::prove_chain_output(&chain)?);
    let settling = chain.settling_samples(SETTLED)?;
    let group_delay_us = microseconds(chain.group_delay_s(DELAY_AT_HZ));
    Ok(MainsFilter {
        mains_hz,
        gains,
        group_delay_us,
        scalp_delay_us: group_delay_us + window_centre_us(description),
        settling_samples: u32::try_from(settling).expect("a response is followed for 2^22 samples"),
        description: prefiltering_text(description, mains_hz),
        sections,
    })
}

/// Returns the time from the middle of a window to its last step, microseconds.
fn window_centre_us(description: &Description) -> u32 {
    let window = &description.window;
    #[expect(clippy::cast_precision_loss, reason = "a window has few steps")]
    let steps = (window.steps - 1) as f64 / 2.0;
    microseconds(steps / f64::from(window.rate_hz))
}

fn microseconds(seconds: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "delays are positive and far below an hour"
    )]
    let microseconds = (seconds * 1e6).round() as u32;
    microseconds
}

/// Returns the text on filters and resampler for the `prefiltering` fields of recordings.
fn prefiltering_text(description: &Description, mains_hz: u32) -> String {
    let (filters, rate_hz) = (&description.filters, description.adc.rate_hz);
    let step_rate_hz = description.window.rate_hz;
    let [low, high] = filters.band_hz;
    let notches: Vec<String> =
        (1..=filters.harmonics + 1).map(|multiple| (multiple * mains_hz).to_string()).collect();
    let decimation = match filters.decimation {
        Decimation::Literal => format!("every {} of {rate_hz} Hz", ordinal(rate_hz / step_rate_hz)),
        Decimation::Fir => {
            format!("Kaiser {CUTOFF_HZ} Hz FIR, {rate_hz} to {step_rate_hz} Hz")
        }
    };
    format!(
        "notch {} Hz Q {}, Butterworth {low}-{high} Hz order {}, {decimation}",
        notches.join(", "),
        filters.notch_q,
        filters.order,
    )
}

fn ordinal(number: u32) -> String {
    let suffix = match number {
        1 => "st",
        2 => "nd",
        3 => "rd",
        _ => "th",
    };
    format!("{number}{suffix}")
}
