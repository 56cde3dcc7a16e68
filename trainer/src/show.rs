//! Shows a model as text or JSON.

use crate::error::TrainerError;
use crate::substitution::figures_text;
use artifact::{Artifact, Figures, Mode, PackedDescription};
use model_gen::{DeviceModel, manifest, memory};
use serde_json::{Value as Json, json};
use std::fmt;
use std::path::Path;

/// A model, together with the integers with which a device computes.
#[derive(Clone, Debug)]
pub(crate) struct Shown {
    artifact: Artifact,
    device: DeviceModel,
}

impl Shown {
    /// Reads a model and turns it into integers.
    ///
    /// # Errors
    /// If the folder holds no usable model, or the model cannot be turned into integers.
    pub(crate) fn read(folder: &Path) -> Result<Self, TrainerError> {
        let artifact = Artifact::read(folder).map_err(TrainerError::no_model(folder))?;
        let device = DeviceModel::new(&artifact)?;
        Ok(Self { artifact, device })
    }

    /// Returns the model as a JSON object: the descriptions of the model and of its packed code,
    /// the tensors' shapes, and flash and RAM of each part of the encoder in bytes. `decodable` is
    /// null without a network, `packed` without a packed code, `substitution` without a table.
    pub(crate) fn to_json(&self) -> Json {
        let Self { artifact, device } = self;
        let description = &artifact.description;
        let tensors = |tensors: &artifact::Tensors| -> Json {
            let shapes = tensors.shapes();
            shapes.map(|(name, shape)| (name.to_owned(), json!(shape))).collect()
        };
        let parts = memory::parts(&device.integers, description.window.hop);
        let parts = parts.iter().map(|part| {
            json!({ "part": part.name, "flash_bytes": part.flash_bytes, "ram_bytes": part.ram_bytes })
        });
        json!({
            "model": artifact.id.to_string(),
            "decodable": description.mode.has_network().then(|| is_decodable(description.mode)),
            "input_scale_uv": device.integers.input_scale_uv,
            "description": description,
            "packed": artifact.packed.as_ref().map(|packed| &packed.description),
            "substitution": artifact.substitution.as_ref().map(|table| &table.description),
            "weights": tensors(&artifact.weights),
            "calibration": tensors(&artifact.calibration),
            "encoder": parts.collect::<Vec<_>>(),
        })
    }
}

/// Returns whether a window can be decoded from its code alone in this mode.
fn is_decodable(mode: Mode) -> bool {
    mode != Mode::Paper
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { artifact, device } = self;
        let description = &artifact.description;
        let (window, card) = (&description.window, &description.training);
        let decodable = match description.mode {
            Mode::Packed => "no network",
            mode if is_decodable(mode) => "decoded from the code alone",
            _ => "cannot be decoded: the pool indices are not sent",
        };
        writeln!(f, "{} mode, {decodable}", description.mode)?;
        let hop_ms = 1e3 * f64::from(u32::try_from(window.hop).unwrap_or(u32::MAX))
            / f64::from(window.rate_hz);
        let code = &description.code;
        let codes = description
            .mode
            .has_network()
            .then(|| format!("a code of {} numbers ({})", code.numbers, code.format));
        let blocks = artifact.packed.as_ref().map(|packed| {
            let PackedDescription { rate, weight, training, .. } = &packed.description;
            let figures = training.figures.iter();
            let block = match figures.clone().find(|figures| figures.rate == *rate) {
                Some(figures) => {
                    format!("a packed block of {:.0} bits (rate {rate})", figures.bits)
                }
                None => format!("a packed block (rate {rate})"),
            };
            let weighted = weight.map(|weight| {
                let ([low, high], strength) = (weight.band_hz, weight.strength);
                format!(", errors at {low} to {high} Hz weighted by {strength}")
            });
            block + &weighted.unwrap_or_default()
        });
        let made: Vec<String> = codes.into_iter().chain(blocks).collect();
        writeln!(
            f,
            "{} electrodes, {} every {hop_ms:.1} ms",
            description.montage.electrodes.len(),
            made.join(" and "),
        )?;
        if let Some(table) = &artifact.substitution {
            let figures = table.description.training.figures.as_ref();
            let figures = figures.map_or_else(|| "not tested".to_owned(), figures_text);
            writeln!(f, "bad electrodes are substituted; {figures}")?;
        }
        writeln!(f)?;
        for row in &description.grid.cells {
            let labels = row.iter().map(|label| format!("{label:>5}"));
            writeln!(f, "{}", labels.collect::<String>())?;
        }
        let electrodes = format!(
            "{} recorded, {} interpolated",
            card.real_electrodes, card.interpolated_electrodes
        );
        writeln!(f)?;
        for (name, text) in [
            ("trained on", &card.dataset),
            ("files", &card.train_files.join(" ")),
            ("tested on", &card.test_files.join(" ")),
            ("training", &card.optimiser),
            ("electrodes", &electrodes),
            ("note", &card.note),
        ] {
            let text = if text.is_empty() { "-" } else { text };
            writeln!(f, "{name:<21} {text}")?;
        }
        if let (Some(mse), Some(prd)) = (&card.mse, &card.prd_percent) {
            writeln!(f, "\ntest                      float   integer  PCA float  PCA integer")?;
            figures(f, "MSE", mse, 5)?;
            figures(f, "PRD, %", prd, 2)?;
        }
        write!(f, "\n{}", manifest(device))
    }
}

fn figures(
    f: &mut fmt::Formatter<'_>,
    name: &str,
    figures: &Figures,
    decimals: usize,
) -> fmt::Result {
    writeln!(
        f,
        "{name:<20} {:>10.decimals$} {:>9.decimals$} {:>10.decimals$} {:>12.decimals$}",
        figures.autoencoder_float, figures.autoencoder_int8, figures.pca_float, figures.pca_int8
    )
}
