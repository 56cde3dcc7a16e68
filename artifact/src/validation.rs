//! What makes a description and its tensors a model that the network code can run.

use crate::description::{Decimation, Description, NetworkShape};
use crate::error::ArtifactError;
use crate::geometry::Geometry;
use crate::scalp_grid::EMPTY;
use crate::shapes::{self, COLUMNS, ELECTRODES, ROWS, STEPS};
use crate::tensors::Tensors;
use std::collections::BTreeSet;
use std::fmt::Debug;

/// The only version of the format so far.
const FORMAT: u32 = 1;
/// Rate of a window's steps, Hz.
const RATE_HZ: u32 = 128;

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

pub(crate) fn description(d: &Description) -> Result<(), ArtifactError> {
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
        "16",
    )?;
    let hop = d.window.hop;
    require(hop == 8 || hop == 16, "window.hop", &hop, "8 or 16")?;
    require(
        d.window.rate_hz == RATE_HZ,
        "window.rate_hz",
        &d.window.rate_hz,
        "128",
    )?;
    network(d)?;
    require(d.grid.rows == ROWS, "grid.rows", &d.grid.rows, "10")?;
    require(
        d.grid.columns == COLUMNS,
        "grid.columns",
        &d.grid.columns,
        "9",
    )?;
    let lengths: Vec<usize> = d.grid.cells.iter().map(Vec::len).collect();
    require(
        lengths == [COLUMNS; ROWS],
        "grid.cells",
        &lengths,
        "10 rows of 9 cells each",
    )?;
    let count = d.montage.electrodes.len();
    require(
        count == ELECTRODES,
        "montage.electrodes",
        &count,
        "61 labels",
    )?;
    labels(d)?;
    converter(d)?;
    filters(d)?;
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
        "at most 61",
    )?;
    require(
        card.interpolated.len() == card.interpolated_electrodes,
        "training.interpolated",
        &card.interpolated.len(),
        "as many labels as training.interpolated_electrodes says",
    )?;
    match card
        .interpolated
        .iter()
        .find(|label| !d.montage.electrodes.contains(label))
    {
        None => Ok(()),
        Some(label) => Err(label_error(
            label,
            "is called interpolated but is not in the montage",
        )),
    }
}

fn label_error(label: &str, problem: &'static str) -> ArtifactError {
    ArtifactError::Label {
        label: label.to_owned(),
        problem,
    }
}

fn labels(d: &Description) -> Result<(), ArtifactError> {
    let mut montage = BTreeSet::new();
    for label in &d.montage.electrodes {
        // Labels travel blank-separated to the host.
        let well_formed = !label.is_empty() && label.chars().all(|c| c.is_ascii_graphic());
        if !well_formed || label == EMPTY {
            return Err(label_error(
                label,
                "is no label (visible ASCII without blanks)",
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

fn network(d: &Description) -> Result<(), ArtifactError> {
    let NetworkShape { padding, pool } = d.network;
    require(
        pool.iter().all(|length| *length > 0),
        "network.pool",
        &pool,
        "at least 1 in steps, rows and columns; [1, 1, 1] is no pool",
    )?;
    let map = Geometry::of(d).feature_map;
    require(
        pool.iter().zip(map).all(|(pool, map)| *pool <= map),
        "network.pool",
        &pool,
        &format!("at most {map:?}, the feature map; make it smaller or pad the convolutions"),
    )?;
    // A pool's steps divide the hop, so that windows that overlap share their pools. Of four steps,
    // the padded first and last pool would leave hardly any to share.
    let (steps, expected) = if padding.pads_time() {
        (&[1, 2][..], "of 1 or 2 steps with padding \"all\"")
    } else {
        (&[1, 2, 4][..], "of 1, 2 or 4 steps, which divide the hop")
    };
    require(steps.contains(&pool[0]), "network.pool", &pool, expected)
}

fn converter(d: &Description) -> Result<(), ArtifactError> {
    let adc = &d.adc;
    require(
        adc.rate_hz >= RATE_HZ,
        "adc.rate_hz",
        &adc.rate_hz,
        "at least 128, the rate of a window's steps",
    )?;
    require(
        d.filters.decimation == Decimation::Fir || adc.rate_hz.is_multiple_of(RATE_HZ),
        "adc.rate_hz",
        &adc.rate_hz,
        "a multiple of 128 when filters.decimation is \"literal\"; \"fir\" takes any rate",
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
        "at least 61, one for each electrode",
    )
}

fn filters(d: &Description) -> Result<(), ArtifactError> {
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
        "so few that 1 + harmonics times the mains frequency lies below half of adc.rate_hz",
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
        "two rising frequencies between 0 and half of adc.rate_hz",
    )?;
    require(
        (1..=8).contains(&filters.order),
        "filters.order",
        &filters.order,
        "1 to 8",
    )
}

pub(crate) fn weights(d: &Description, tensors: &Tensors) -> Result<(), ArtifactError> {
    let expected = shapes::weight_shapes(d.mode, &Geometry::of(d));
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

pub(crate) fn calibration(d: &Description, tensors: &Tensors) -> Result<(), ArtifactError> {
    let expected = shapes::calibration(d.mode);
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
    let code = [shapes::CODE];
    let low = tensors.tensor("code.min", &code)?;
    let high = tensors.tensor("code.max", &code)?;
    match low.iter().zip(high).position(|(low, high)| low >= high) {
        None => Ok(()),
        Some(index) => Err(tensors.range_error("code.max", index, "must be above code.min")),
    }
}
