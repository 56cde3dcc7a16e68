//! The model as the scripts in Python get it.

use artifact::Description;
use serde_json::{Value as Json, json};

use super::checked_in::ARTIFACT;

/// Returns what `offline_torch.py` and `rospy_node.py` need to filter and to encode.
pub(crate) fn request(description: &Description) -> Json {
    let filters = &description.filters;
    json!({
        "artifact": ARTIFACT,
        "cells": model::GRID_CELL.as_slice(),
        "numbers": model::CODE,
        "steps": model::STEPS,
        "hop": model::HOP,
        "rows": model::ROWS,
        "columns": model::COLUMNS,
        "decimation": model::ADC_RATE_HZ / model::STEP_RATE_HZ,
        "sd_uv": description.input.sd_uv,
        "rate_hz": model::ADC_RATE_HZ,
        "mains_hz": 50,
        "notch_q": filters.notch_q,
        "band_hz": filters.band_hz,
        "order": filters.order,
    })
}
