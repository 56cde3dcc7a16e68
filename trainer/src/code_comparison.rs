//! The codes of a network beside those of PCA with as many numbers.

use crate::band_power::BandPower;
use crate::dataset::Dataset;
use crate::electrode_error::{ElectrodeError, ElectrodeSums};
use crate::error::TrainerError;
use crate::evaluate::{CodedBlock, Evaluation, evaluate_blocks};
use crate::overlap::OverlapMean;
use crate::truncation::{TruncationError, TruncationSums};
use artifact::{Artifact, Mode, Pca};
use serde_json::{Value as Json, json};

/// Figures of a network's codes, and of PCA with the same number of components, on the same recordings.
#[derive(Clone, Debug)]
pub struct CodeComparison {
    /// Figures of the network.
    pub network: Evaluation,
    /// Figures of PCA; `None` if the artifact has no `pca.safetensors`.
    pub pca: Option<Evaluation>,
    /// Number of numbers in a code.
    pub numbers: usize,
    /// Errors of the network at each electrode, in the order of the montage.
    pub electrode_errors: Vec<ElectrodeError>,
    /// Errors of PCA with fewer numbers, in ascending order, up to all of them; empty without PCA.
    pub pca_by_numbers: Vec<TruncationError>,
    /// Correlation of band powers with those of the original, of the network's integer codes: overlapping windows are
    /// averaged, as in a stream. The bands are those of [`RateFigures`](crate::packed::RateFigures).
    pub network_bands: [f64; 2],
    /// Correlation of band powers of PCA's integer codes.
    pub pca_bands: Option<[f64; 2]>,
}

impl CodeComparison {
    /// Measures a network and its PCA on a dataset in units of `input.sd_uv`. `is_recorded` tells whether every
    /// recording has an electrode.
    ///
    /// # Errors
    /// If the model cannot be turned into integers, or its codes cannot be decoded.
    pub(crate) fn new(
        model: &Artifact,
        pca: Option<&Pca>,
        dataset: &Dataset,
        is_recorded: impl Fn(&String) -> bool,
    ) -> Result<Self, TrainerError> {
        let description = &model.description;
        let mut electrodes = ElectrodeSums::new(description.montage.electrodes.len());
        let is_pca = description.mode == Mode::Pca;
        let mut truncation = is_pca.then(|| TruncationSums::new(model)).transpose()?;
        let (network, network_bands) = evaluate_with_bands(model, dataset, |block| {
            electrodes.add(block);
            if let Some(sums) = &mut truncation {
                sums.add(block);
            }
        })?;
        let pca = match pca {
            _ if is_pca => Some((network, network_bands)),
            Some(pca) => {
                let linear = pca.to_model(description.clone())?;
                let sums = truncation.insert(TruncationSums::new(&linear)?);
                Some(evaluate_with_bands(&linear, dataset, |block| {
                    sums.add(block);
                })?)
            }
            None => None,
        };
        Ok(Self {
            network,
            pca: pca.map(|(evaluation, _)| evaluation),
            numbers: description.code.numbers,
            electrode_errors: electrodes.errors(description, is_recorded),
            pca_by_numbers: truncation.map_or_else(Vec::new, |sums| sums.errors_by_numbers()),
            network_bands,
            pca_bands: pca.map(|(_, bands)| bands),
        })
    }

    /// Returns the figures as a JSON object.
    pub(crate) fn to_json(&self) -> Json {
        let pca = self.pca.as_ref();
        json!({
            "windows": self.network.windows,
            "numbers": self.numbers,
            "code_format": self.network.format.to_string(),
            "bits_per_window": self.bits_per_window(),
            "mse_float": self.network.float.mse,
            "mse_int8": self.network.integer.mse,
            "mse_pca": pca.map(|pca| pca.float.mse),
            "mse_pca_int8": pca.map(|pca| pca.integer.mse),
            "prd_percent_float": self.network.float.prd_percent,
            "prd_percent_int8": self.network.integer.prd_percent,
            "prd_percent_pca": pca.map(|pca| pca.float.prd_percent),
            "prd_percent_pca_int8": pca.map(|pca| pca.integer.prd_percent),
            "band_correlation_8_13": self.network_bands[0],
            "band_correlation_13_30": self.network_bands[1],
            "band_correlation_8_13_pca": self.pca_bands.map(|bands| bands[0]),
            "band_correlation_13_30_pca": self.pca_bands.map(|bands| bands[1]),
            "input_clipped": self.network.input_clipped,
            "codes_at_rail": self.network.code_clipped,
        })
    }

    /// Returns the number of bits of an integer code.
    pub fn bits_per_window(&self) -> usize {
        self.bits_of(self.numbers)
    }

    /// Returns the number of bits of an integer code with this number of numbers.
    pub fn bits_of(&self, numbers: usize) -> usize {
        self.network.format.bits(numbers)
    }
}

/// Measures a model; returns its figures, and the correlation of band powers with its integer codes.
fn evaluate_with_bands(
    model: &Artifact,
    dataset: &Dataset,
    mut observe: impl FnMut(&CodedBlock),
) -> Result<(Evaluation, [f64; 2]), TrainerError> {
    let description = &model.description;
    let mut decoded = OverlapMean::new(dataset, description.window.hop);
    let evaluation = evaluate_blocks(model, dataset, |block| {
        decoded.add(block.decoded_received);
        observe(block);
    })?;
    let band_power = BandPower::new(
        description.montage.electrodes.len(),
        description.window.rate_hz,
    );
    let bands = band_power.correlation(&decoded.original(), &decoded.mean());
    Ok((evaluation, bands))
}
