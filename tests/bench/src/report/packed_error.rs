//! Bits and error of the packed code on recordings that it was not trained on, beside PCA's codes.

use std::env;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::Serialize;
use trainer::comparison;
use trainer::progress::ProgressObserver;

use super::checked_in;

/// Folder of the recordings below that in `CORTICODE_DATA`.
const FOLDER: &str = "eegmmidb_S001";
/// Recordings: 125 s each, mains at 60 Hz, not used in training.
const RECORDINGS: [&str; 2] = ["S001R11.edf", "S001R12.edf"];
const MAINS_HZ: u32 = 60;

/// Figures at the model's own rate, at every rate, and of PCA's codes.
#[derive(Debug)]
pub(crate) struct Errors {
    pub(crate) bits_per_hop: f64,
    pub(crate) mse: f64,
    pub(crate) mse_smoothed: f64,
    pub(crate) pca_int8_bits: usize,
    pub(crate) pca_int8_mse: Option<f64>,
    pub(crate) rates: Vec<RateFigures>,
}

/// Figures of one rate.
#[derive(Debug, Serialize)]
pub(crate) struct RateFigures {
    rate: u8,
    bits_per_hop: f64,
    longest_bytes: usize,
    mse: f64,
    mse_smoothed: f64,
}

/// Measures the built-in model; `None` where `CORTICODE_DATA` is not set.
///
/// # Errors
/// The recordings or the model cannot be used.
pub(crate) fn measure() -> anyhow::Result<Option<Errors>> {
    let Some(data) = env::var_os("CORTICODE_DATA").filter(|folder| !folder.is_empty()) else {
        eprintln!(
            "SKIPPED: error of the packed code: CORTICODE_DATA is not set; it names the folder that has {FOLDER}"
        );
        return Ok(None);
    };
    let (folder, data) = (
        Path::new(checked_in::ARTIFACT),
        PathBuf::from(data).join(FOLDER),
    );
    let names = RECORDINGS.map(str::to_owned);
    let comparison = comparison::compare(folder, &data, &names, Some(MAINS_HZ), &mut Silent)?;
    let figures = comparison.packed;
    let codes = comparison
        .codes
        .context("the built-in model has no network")?;
    let artifact = checked_in::artifact()?;
    let model = artifact
        .packed
        .context("the built-in model has no packed model")?;
    let own = figures
        .iter()
        .find(|figures| figures.rate == model.description.rate);
    let own = own.context("figures of the model's rate")?;
    Ok(Some(Errors {
        bits_per_hop: own.bits,
        mse: own.mse,
        mse_smoothed: own.mse_smoothed,
        pca_int8_bits: codes.bits_per_window(),
        pca_int8_mse: codes.pca.map(|pca| pca.integer.mse),
        rates: figures
            .iter()
            .map(|figures| RateFigures {
                rate: figures.rate,
                bits_per_hop: figures.bits,
                longest_bytes: figures.longest,
                mse: figures.mse,
                mse_smoothed: figures.mse_smoothed,
            })
            .collect(),
    }))
}

/// Shows no progress.
struct Silent;

impl ProgressObserver for Silent {
    fn message(&mut self, _text: &str) {}
}
