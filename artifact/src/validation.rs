//! Checks that a description and its tensors are a model that the network code can run.

use crate::description::{Decimation, Description, EMPTY, NetworkShape};
use crate::dimensions::{CODE, COLUMNS, ELECTRODES, ROWS, STEPS};
use crate::error::ArtifactError;
use crate::geometry::Geometry;
use crate::shapes::{calibration_shapes, weight_shapes};
use crate::tensors::Tensors;
use std::collections::BTreeSet;
use std::fmt::Debug;

/// Supported version of the artifact format.
const FORMAT: u32 = 1;
/// Rate of the time steps that a description must state, Hz.
const RATE_HZ: u32 = 128;

/// Returns an error that names `field`, its value and the `expected` values unless `holds`.
fn require(
    holds: bool,
    field: &'static str,
    found: &dyn Debug,
    expected: &str,
) -> Result<(), ArtifactError> {
    if holds {
        return Ok(());
    }
    Err(ArtifactError::Field {
        field,
        found: format!("{found:?}"),
        expected: expected.to_owned(),
    })
}

/// Returns an error if a field of the description has an invalid value.
pub(crate) fn check_description(d: &Description) -> Result<(), ArtifactError> {
    require(
        d.format == FORMAT,
        "format",
        &d.format,
        "1 (a newer format needs newer tools)",
    )?;
    require(
        d.window.steps == STEPS,
        "window.steps",
        &d.window.steps,
        &STEPS.to_string(),
    )?;
    let hop = d.window.hop;
    require(hop == 8 || hop == 16, "window.hop", &hop, "8 or 16")?;
    require(
        d.window.rate_hz == RATE_HZ,
        "window.rate_hz",
        &d.window.rate_hz,
        &RATE_HZ.to_string(),
    )?;
    check_network(d)?;
    require(
        d.grid.rows == ROWS,
        "grid.rows",
        &d.grid.rows,
        &ROWS.to_string(),
    )?;
    require(
        d.grid.columns == COLUMNS,
        "grid.columns",
        &d.grid.columns,
        &COLUMNS.to_string(),
    )?;
    let lengths: Vec<usize> = d.grid.cells.iter().map(Vec::len).collect();
    require(
        lengths == [COLUMNS; ROWS],
        "grid.cells",
        &lengths,
        &format!("{ROWS} rows of {COLUMNS} cells each"),
    )?;
    let count = d.montage.electrodes.len();
    require(
        count == ELECTRODES,
        "montage.electrodes",
        &count,
        &format!("{ELECTRODES} labels"),
    )?;
    check_labels(d)?;
    check_adc(d)?;
    check_filters(d)?;
    let sd = d.input.sd_uv;
    require(
        sd.is_finite() && sd > 0.0,
        "input.sd_uv",
        &sd,
        "a positive number of uV",
    )?;
    let card = &d.training;
    let electrodes = card.real_electrodes + card.interpolated_electrodes;
    require(
        electrodes <= ELECTRODES,
        "training.real_electrodes plus training.interpolated_electrodes",
        &electrodes,
        &format!("at most {ELECTRODES}"),
    )?;
    require(
        card.interpolated.len() == card.interpolated_electrodes,
        "training.interpolated",
        &card.interpolated.len(),
        "one label for each of training.interpolated_electrodes",
    )?;
    match card
        .interpolated
        .iter()
        .find(|label| !d.montage.electrodes.contains(label))
    {
        None => Ok(()),
        Some(label) => Err(label_error(
            label,
            "is listed as interpolated but is not in the montage",
        )),
    }
}

fn label_error(label: &str, problem: &'static str) -> ArtifactError {
    ArtifactError::Label {
        label: label.to_owned(),
        problem,
    }
}

fn check_labels(d: &Description) -> Result<(), ArtifactError> {
    let mut montage = BTreeSet::new();
    for label in &d.montage.electrodes {
        // Labels are sent to the host separated by blanks.
        let well_formed = !label.is_empty() && label.chars().all(|c| c.is_ascii_graphic());
        if !well_formed || label == EMPTY {
            return Err(label_error(
                label,
                "is not a label (visible ASCII without blanks)",
            ));
        }
        if !montage.insert(label) {
            return Err(label_error(label, "is in the montage twice"));
        }
    }
    let mut grid = BTreeSet::new();
    for label in d
        .grid
        .cells
        .iter()
        .flatten()
        .filter(|label| *label != EMPTY)
    {
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

fn check_network(d: &Description) -> Result<(), ArtifactError> {
    let NetworkShape { padding, pool } = d.network;
    require(
        pool.iter().all(|length| *length > 0),
        "network.pool",
        &pool,
        "at least 1 in steps, rows and columns; [1, 1, 1] means no pool",
    )?;
    let map = Geometry::new(&d.network).feature_map;
    require(
        pool.iter().zip(map).all(|(pool, map)| *pool <= map),
        "network.pool",
        &pool,
        &format!("at most {map:?}, the feature map; make it smaller or pad the convolutions"),
    )?;
    // The steps of a pool divide the hop, so that overlapping windows share pools. With padded steps,
    // windows cannot share the first and the last pool; of the four pools of four steps, that would be
    // half.
    let (steps, expected) = if padding.pads_time() {
        (&[1, 2][..], "of 1 or 2 steps with padding \"all\"")
    } else {
        (&[1, 2, 4][..], "of 1, 2 or 4 steps, which divide the hop")
    };
    require(steps.contains(&pool[0]), "network.pool", &pool, expected)
}

fn check_adc(d: &Description) -> Result<(), ArtifactError> {
    let adc = &d.adc;
    require(
        adc.rate_hz >= RATE_HZ,
        "adc.rate_hz",
        &adc.rate_hz,
        &format!("at least {RATE_HZ}, the rate of the time steps"),
    )?;
    require(
        d.filters.decimation == Decimation::Fir || adc.rate_hz.is_multiple_of(RATE_HZ),
        "adc.rate_hz",
        &adc.rate_hz,
        &format!(
            "a multiple of {RATE_HZ} when filters.decimation is \"literal\"; \"fir\" takes any rate"
        ),
    )?;
    require(
        adc.vref_v.is_finite() && adc.vref_v > 0.0,
        "adc.vref_v",
        &adc.vref_v,
        "a positive number of V",
    )?;
    require(adc.gain > 0, "adc.gain", &adc.gain, "at least 1")?;
    require(
        adc.channels >= ELECTRODES,
        "adc.channels",
        &adc.channels,
        &format!("at least {ELECTRODES}, one for each electrode"),
    )
}

fn check_filters(d: &Description) -> Result<(), ArtifactError> {
    let filters = &d.filters;
    let nyquist = f64::from(d.adc.rate_hz) / 2.0;
    require(
        !filters.mains_hz.is_empty()
            && filters
                .mains_hz
                .iter()
                .all(|&hz| hz > 0 && f64::from(hz) < nyquist),
        "filters.mains_hz",
        &filters.mains_hz,
        "one or more frequencies below half of adc.rate_hz",
    )?;
    let highest_mains = filters.mains_hz.iter().copied().max().unwrap_or(0);
    let highest_notch = (f64::from(filters.harmonics) + 1.0) * f64::from(highest_mains);
    require(
        highest_notch < nyquist,
        "filters.harmonics",
        &filters.harmonics,
        "small enough that (1 + harmonics) times the mains frequency is below half of adc.rate_hz",
    )?;
    require(
        filters.notch_q.is_finite() && filters.notch_q > 0.0,
        "filters.notch_q",
        &filters.notch_q,
        "a positive number",
    )?;
    let [low, high] = filters.band_hz;
    require(
        0.0 < low && low < high && high < nyquist,
        "filters.band_hz",
        &filters.band_hz,
        "two increasing frequencies between 0 and half of adc.rate_hz",
    )?;
    require(
        (1..=8).contains(&filters.order),
        "filters.order",
        &filters.order,
        "1 to 8",
    )
}

/// Returns an error if the weights are not those of the description's mode and shape.
pub(crate) fn check_weights(d: &Description, tensors: &Tensors) -> Result<(), ArtifactError> {
    let expected = weight_shapes(d.mode, &Geometry::new(&d.network));
    tensors.check(&expected)?;
    for (name, shape) in expected
        .iter()
        .filter(|(name, _)| name.ends_with("running_var"))
    {
        let variances = tensors.tensor(name, shape)?;
        if let Some(index) = variances.iter().position(|variance| *variance < 0.0) {
            return Err(tensors.range_error(name, index, "a variance cannot be negative"));
        }
    }
    Ok(())
}

/// Returns an error if the calibration is not that of the description's mode, or a range is empty.
pub(crate) fn check_calibration(d: &Description, tensors: &Tensors) -> Result<(), ArtifactError> {
    let expected = calibration_shapes(d.mode);
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
    let code = [CODE];
    let low = tensors.tensor("code.min", &code)?;
    let high = tensors.tensor("code.max", &code)?;
    match low.iter().zip(high).position(|(low, high)| low >= high) {
        None => Ok(()),
        Some(index) => Err(tensors.range_error("code.max", index, "must be above code.min")),
    }
}
