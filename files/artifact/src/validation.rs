//! Checks that a description and its tensors form a valid model.

use crate::description::{
    AdcClock, AdcControl, AdcWiring, Decimation, Description, EMPTY, NetworkShape,
};
use crate::error::{ArtifactError, List};
use crate::folder::DESCRIPTION;
use crate::geometry::Geometry;
use crate::shapes::{calibration_shapes, weight_shapes};
use crate::tensors::Tensors;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::ops::RangeInclusive;

/// Version of the artifact format that this crate reads and writes.
const FORMAT: u32 = 1;
/// The only rate of time steps that a description may state, Hz.
const RATE_HZ: u32 = 128;
/// Numbers of time steps that a window may have.
const STEPS: [usize; 2] = [16, 32];
/// Numbers of time steps that a hop may have.
const HOPS: [usize; 3] = [4, 8, 16];
/// Largest number of rows, and also of columns, of the scalp grid.
pub const LARGEST_SIDE: usize = 12;
/// Permitted numbers of electrodes: at most 64, so that a 64-bit mask can mark channels at the
/// rail.
pub const ELECTRODES: RangeInclusive<usize> = 4..=64;
/// Permitted numbers of values in a code.
const NUMBERS: RangeInclusive<usize> = 8..=256;
/// The number of values in a code must be a multiple of this number, because the kernels of the
/// linear layers compute four outputs at a time.
const NUMBERS_MULTIPLE: usize = 4;
/// Smallest number of columns that the pools of a row may cover together, because the convolutions
/// compute three columns at a time.
const COLUMNS_AT_A_TIME: usize = 3;
/// Sampling rates of an ADS1299, Hz: its master clock of 2.048 MHz or 2.097152 MHz divided by
/// powers of two (datasheet SBAS499, section 9.6.1.2).
pub const ADC_RATES_HZ: [u32; 6] = [250, 256, 500, 512, 1000, 1024];
/// Gains of the ADS1299's input amplifier (datasheet section 9.6.1.6).
pub const GAINS: [u32; 7] = [1, 2, 4, 6, 8, 12, 24];
/// Internal reference of an ADS1299, V (datasheet section 7.5).
const VREF_V: f64 = 4.5;
/// Number of channels of each ADS1299 chip.
pub const CHIP_CHANNELS: usize = 8;
/// Largest number of ADS1299 chips in a chain.
pub const LARGEST_CHAIN: usize = 8;

/// Name and value of a field of the description that is being checked.
struct Field<'d>(&'static str, &'d dyn Display);

impl Field<'_> {
    /// If `holds` is false, returns an error that names the field, its value and the `expected`
    /// values.
    fn must(self, holds: bool, expected: impl Into<String>) -> Result<(), ArtifactError> {
        if holds {
            return Ok(());
        }
        Err(ArtifactError::Field {
            file: DESCRIPTION,
            field: self.0,
            found: self.1.to_string(),
            expected: expected.into(),
        })
    }
}

/// Checks every field of a description, before work starts on its model.
///
/// # Errors
/// If a field has a value that no model can have.
pub fn check_description(d: &Description) -> Result<(), ArtifactError> {
    let expected = "1 (a newer format needs newer tools)";
    Field("format", &d.format).must(d.format == FORMAT, expected)?;
    check_window(d)?;
    check_numbers(d)?;
    check_grid(d)?;
    let count = d.montage.electrodes.len();
    let expected = format!("{} to {} labels", ELECTRODES.start(), ELECTRODES.end());
    Field("montage.electrodes", &count).must(ELECTRODES.contains(&count), expected)?;
    check_labels(d)?;
    let pool = d.network.pool;
    let expected = "at least 1 in steps, rows and columns; [1, 1, 1] means no pool";
    Field("network.pool", &List(&pool)).must(pool.iter().all(|length| *length > 0), expected)?;
    if d.mode.has_convolutions() {
        check_convolutions(d)?;
    }
    check_adc(d)?;
    check_filters(d)?;
    let sd = d.input.sd_uv;
    Field("input.sd_uv", &sd).must(sd.is_finite() && sd > 0.0, "a positive number of uV")?;
    let card = &d.training;
    let electrodes = card.real_electrodes + card.interpolated_electrodes;
    let expected = format!("at most {count}, the number of electrodes");
    Field("training.real_electrodes plus training.interpolated_electrodes", &electrodes)
        .must(electrodes <= count, expected)?;
    let expected = "one label for each of training.interpolated_electrodes";
    Field("training.interpolated", &card.interpolated.len())
        .must(card.interpolated.len() == card.interpolated_electrodes, expected)?;
    match card.interpolated.iter().find(|label| !d.montage.electrodes.contains(label)) {
        None => Ok(()),
        Some(label) => {
            Err(label_error(label, "is listed as interpolated but is not in the montage"))
        }
    }
}

fn check_window(d: &Description) -> Result<(), ArtifactError> {
    let window = &d.window;
    Field("window.steps", &window.steps).must(STEPS.contains(&window.steps), "16 or 32")?;
    Field("window.hop", &window.hop).must(HOPS.contains(&window.hop), "4, 8 or 16")?;
    Field("window.rate_hz", &window.rate_hz).must(window.rate_hz == RATE_HZ, RATE_HZ.to_string())
}

fn check_numbers(d: &Description) -> Result<(), ArtifactError> {
    let numbers = d.code.numbers;
    if !d.mode.has_network() {
        let expected = "0, because mode \"packed\" has no network";
        return Field("code.numbers", &numbers).must(numbers == 0, expected);
    }
    let expected =
        format!("{} to {}, and a multiple of {NUMBERS_MULTIPLE}", NUMBERS.start(), NUMBERS.end());
    Field("code.numbers", &numbers)
        .must(NUMBERS.contains(&numbers) && numbers.is_multiple_of(NUMBERS_MULTIPLE), expected)
}

fn check_grid(d: &Description) -> Result<(), ArtifactError> {
    let grid = &d.grid;
    for (field, length) in [("grid.rows", grid.rows), ("grid.columns", grid.columns)] {
        Field(field, &length)
            .must((1..=LARGEST_SIDE).contains(&length), format!("1 to {LARGEST_SIDE}"))?;
    }
    let lengths: Vec<usize> = grid.cells.iter().map(Vec::len).collect();
    let expected = format!("{} rows of {} cells each", grid.rows, grid.columns);
    Field("grid.cells", &List(&lengths)).must(lengths == vec![grid.columns; grid.rows], expected)
}

fn label_error(label: &str, problem: &'static str) -> ArtifactError {
    ArtifactError::Label { label: label.to_owned(), problem }
}

fn check_labels(d: &Description) -> Result<(), ArtifactError> {
    let mut montage = BTreeSet::new();
    for label in &d.montage.electrodes {
        // The device sends the labels to the host as one text, separated by blanks.
        let well_formed = !label.is_empty() && label.chars().all(|c| c.is_ascii_graphic());
        if !well_formed || label == EMPTY {
            return Err(label_error(label, "is not a label (visible ASCII without blanks)"));
        }
        if !montage.insert(label) {
            return Err(label_error(label, "is in the montage twice"));
        }
    }
    let mut grid = BTreeSet::new();
    for label in d.grid.cells.iter().flatten().filter(|label| *label != EMPTY) {
        if !montage.contains(label) {
            return Err(label_error(label, "is on the grid but not in the montage"));
        }
        if !grid.insert(label) {
            return Err(label_error(label, "is on the grid twice"));
        }
    }
    match montage.difference(&grid).next() {
        None => Ok(()),
        Some(label) => Err(label_error(label, "is in the montage but not on the grid")),
    }
}

fn check_convolutions(d: &Description) -> Result<(), ArtifactError> {
    let NetworkShape { padding, pool } = d.network;
    let map = Geometry::new(d).feature_map;
    let expected = "at least 5 x 5 cells for convolutions without padding; choose network.padding \"space\", or mode \"pca\", \
         which has no convolutions";
    Field("grid", &format_args!("{} x {} cells", d.grid.rows, d.grid.columns))
        .must(map.iter().all(|length| *length > 0), expected)?;
    let expected =
        format!("at most {}, the feature map; make it smaller or pad the convolutions", List(&map));
    Field("network.pool", &List(&pool))
        .must(pool.iter().zip(map).all(|(pool, map)| *pool <= map), expected)?;
    let expected = format!(
        "such that the pools of a row cover at least {COLUMNS_AT_A_TIME} of the feature map's {} columns",
        map[2]
    );
    Field("network.pool", &List(&pool))
        .must(map[2] / pool[2] * pool[2] >= COLUMNS_AT_A_TIME, expected)?;
    // The number of steps in a hop must be a multiple of the number of steps in a pool, so that
    // overlapping windows share pools. With padding in time, windows do not share their first and
    // last pools. With pools of four steps, these would be two of a window's four pools, so pools
    // of four steps are refused.
    let (steps, expected) = if padding.pads_time() {
        (&[1, 2][..], "of 1 or 2 steps with padding \"all\"")
    } else {
        (&[1, 2, 4][..], "of 1, 2 or 4 steps, which divide the hop")
    };
    Field("network.pool", &List(&pool)).must(steps.contains(&pool[0]), expected)
}

fn check_adc(d: &Description) -> Result<(), ArtifactError> {
    let adc = &d.adc;
    let expected = "250, 256, 500, 512, 1000 or 1024, the rates of an ADS1299 with a clock of 2.048 or 2.097152 MHz";
    Field("adc.rate_hz", &adc.rate_hz).must(ADC_RATES_HZ.contains(&adc.rate_hz), expected)?;
    let expected = format!(
        "a multiple of {RATE_HZ} when filters.decimation is \"literal\"; \"fir\" takes any rate"
    );
    Field("adc.rate_hz", &adc.rate_hz).must(
        d.filters.decimation == Decimation::Fir || adc.rate_hz.is_multiple_of(RATE_HZ),
        expected,
    )?;
    let expected = "4.5, the internal reference of an ADS1299";
    Field("adc.vref_v", &adc.vref_v).must(adc.vref_v.to_bits() == VREF_V.to_bits(), expected)?;
    let expected = "1, 2, 4, 6, 8, 12 or 24, the gains of an ADS1299";
    Field("adc.gain", &adc.gain).must(GAINS.contains(&adc.gain), expected)?;
    let electrodes = d.montage.electrodes.len();
    let least = electrodes.next_multiple_of(CHIP_CHANNELS);
    let most = CHIP_CHANNELS * LARGEST_CHAIN;
    let expected = format!(
        "a multiple of {CHIP_CHANNELS} from {least} to {most}: {CHIP_CHANNELS} for each ADS1299, and one \
             for each of {electrodes} electrodes"
    );
    Field("adc.channels", &adc.channels).must(
        adc.channels.is_multiple_of(CHIP_CHANNELS) && (least..=most).contains(&adc.channels),
        expected,
    )?;
    let is_decimal = [250, 500, 1000].contains(&adc.rate_hz);
    Field("adc.clock", &"internal").must(
        adc.clock == AdcClock::External || (is_decimal && adc.channels == CHIP_CHANNELS),
        "\"external\" for several chips and at other rates than 250, 500 and 1000 Hz: the oscillator inside an \
         ADS1299 clocks that chip alone",
    )?;
    let is_cascaded = adc.wiring == AdcWiring::Cascaded && adc.channels > CHIP_CHANNELS;
    Field("adc.control", &"commands").must(
        adc.control == AdcControl::Pins || !is_cascaded,
        "\"pins\" for several cascaded chips: opcodes reach them one after the other, so they would \
         not sample at the same time",
    )
}

fn check_filters(d: &Description) -> Result<(), ArtifactError> {
    let filters = &d.filters;
    let nyquist = f64::from(d.adc.rate_hz) / 2.0;
    let expected = "one or more frequencies below half of adc.rate_hz";
    Field("filters.mains_hz", &List(&filters.mains_hz)).must(
        !filters.mains_hz.is_empty()
            && filters.mains_hz.iter().all(|&hz| hz > 0 && f64::from(hz) < nyquist),
        expected,
    )?;
    let highest_mains = filters.mains_hz.iter().copied().max().unwrap_or(0);
    let highest_notch = (f64::from(filters.harmonics) + 1.0) * f64::from(highest_mains);
    let expected =
        "small enough that (1 + harmonics) times the mains frequency is below half of adc.rate_hz";
    Field("filters.harmonics", &filters.harmonics).must(highest_notch < nyquist, expected)?;
    Field("filters.notch_q", &filters.notch_q)
        .must(filters.notch_q.is_finite() && filters.notch_q > 0.0, "a positive number")?;
    let [low, high] = filters.band_hz;
    let expected = "two increasing frequencies between 0 and half of adc.rate_hz";
    Field("filters.band_hz", &List(&filters.band_hz))
        .must(0.0 < low && low < high && high < nyquist, expected)?;
    Field("filters.order", &filters.order).must((1..=8).contains(&filters.order), "1 to 8")
}

/// Returns an error if a tensor is not as the description's mode and geometry require, or if a
/// variance is negative.
pub(crate) fn check_weights(d: &Description, tensors: &Tensors) -> Result<(), ArtifactError> {
    let expected = weight_shapes(d.mode, &Geometry::new(d));
    tensors.check(&expected)?;
    for (name, shape) in expected.iter().filter(|(name, _)| name.ends_with("running_var")) {
        let variances = tensors.tensor(name, shape)?;
        if let Some(index) = variances.iter().position(|variance| *variance < 0.0) {
            return Err(tensors.range_error(name, index, "a variance cannot be negative"));
        }
    }
    Ok(())
}

/// Returns an error if a tensor that the description requires is missing, a largest magnitude is
/// not positive, or a range is empty.
pub(crate) fn check_calibration(d: &Description, tensors: &Tensors) -> Result<(), ArtifactError> {
    let expected = calibration_shapes(d.mode, &d.dimensions());
    tensors.check(&expected)?;
    for (name, shape) in &expected {
        let values = tensors.tensor(name, shape)?;
        if name.starts_with("code.") {
            continue;
        }
        if let Some(index) = values.iter().position(|value| *value <= 0.0) {
            return Err(tensors.range_error(name, index, "a largest magnitude must be positive"));
        }
    }
    if !d.mode.has_network() {
        return Ok(());
    }
    let code = [d.code.numbers];
    let low = tensors.tensor("code.min", &code)?;
    let high = tensors.tensor("code.max", &code)?;
    match low.iter().zip(high).position(|(low, high)| low >= high) {
        None => Ok(()),
        Some(index) => Err(tensors.range_error("code.max", index, "must be above code.min")),
    }
}
