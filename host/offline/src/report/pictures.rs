//! Draws the pictures of one decoded recording.

use std::path::Path;

use artifact::Description;
use picture::histogram::Histogram;
use picture::scalp_map::{Place, ScalpMap, on_map};
use picture::traces::{Trace, Traces};
use recordings::Position;

use super::Entry;
use crate::comparison::{Comparison, ElectrodeOrigin};
use crate::error::OfflineError;

/// File name of the picture of original and decoded signal.
pub(super) const TRACES: &str = "traces.svg";
/// File name of the map of the electrodes' errors.
pub(super) const SCALP: &str = "scalp.svg";
/// File name of the histogram of the codes' values.
pub(super) const LEVELS: &str = "levels.svg";
/// Largest number of electrodes in the picture of traces.
const SHOWN: usize = 8;

/// Draws the pictures of an entry into a folder.
///
/// # Errors
/// [`OfflineError::Picture`] if a file cannot be written.
pub(super) fn draw(
    folder: &Path,
    description: &Description,
    entry: &Entry,
) -> Result<(), OfflineError> {
    if let Some(comparison) = entry.compared() {
        traces(description, comparison, entry).draw(&folder.join(TRACES))?;
        scalp_map(description, comparison, &entry.name).draw(&folder.join(SCALP))?;
    }
    if !entry.decoded.is_packed() {
        levels(entry).draw(&folder.join(LEVELS))?;
    }
    Ok(())
}

fn traces(description: &Description, comparison: &Comparison, entry: &Entry) -> Traces {
    let labels = &description.montage.electrodes;
    let excerpt = &comparison.excerpt;
    let rows = shown(comparison).into_iter().map(|electrode| {
        let part = |steps: &[Vec<f32>]| steps.iter().map(|step| step[electrode]).collect();
        Trace {
            label: labels[electrode].clone(),
            source_uv: part(&excerpt.original_uv),
            result_uv: part(&excerpt.decoded_uv),
        }
    });
    let rate_hz = f64::from(description.window.rate_hz);
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 rows")]
    let start_s = excerpt.first_row as f64 / rate_hz;
    Traces {
        rows: rows.collect(),
        rate_hz,
        start_s,
        since: "the first decoded step".to_owned(),
        result: match entry.decoded.bits_per_block() {
            Some(bits) => format!("decoded from {bits:.1} bits per block"),
            None => format!("decoded from {} numbers", description.code.numbers),
        },
        subtitle: format!(
            "{}: PRD {:.1} % over all {} electrodes and {} steps",
            entry.name,
            comparison.total().prd_percent(),
            labels.len(),
            comparison.steps
        ),
    }
}

/// Returns the electrodes to show, evenly spaced over the measured ones.
fn shown(comparison: &Comparison) -> Vec<usize> {
    let electrodes = comparison.origins.iter().enumerate();
    let measured = electrodes.filter(|(_, origin)| **origin == ElectrodeOrigin::Measured);
    let measured: Vec<usize> = measured.map(|(electrode, _)| electrode).collect();
    let count = SHOWN.min(measured.len());
    (0..count).map(|place| measured[place * measured.len() / count]).collect()
}

fn scalp_map(description: &Description, comparison: &Comparison, name: &str) -> ScalpMap {
    let electrodes = description.montage.electrodes.iter();
    let errors = comparison.electrodes.iter().zip(&comparison.origins);
    let places = electrodes.zip(errors).filter_map(|(label, (error, origin))| {
        let value = error.prd_percent();
        let Position { x, y, z } = Position::from_label(label)?;
        value.is_finite().then(|| Place {
            label: label.clone(),
            at: on_map([x, y, z]),
            value,
            is_measured: *origin == ElectrodeOrigin::Measured,
        })
    });
    ScalpMap {
        places: places.collect(),
        title: "Error of each electrode".to_owned(),
        subtitle: format!(
            "{name}: PRD, 100 sqrt(sum of squared difference / sum of squared original)"
        ),
        unit: "%".to_owned(),
    }
}

fn levels(entry: &Entry) -> Histogram {
    let levels = &entry.decoded.levels;
    Histogram {
        range: [f64::from(-levels.span), f64::from(levels.span)],
        counts: levels.bins.to_vec(),
        title: "Levels of the codes".to_owned(),
        subtitle: format!(
            "{}: {} values in {} codes, {} at an end of the range",
            entry.name,
            levels.values(),
            entry.decoded.codes,
            levels.at_ends
        ),
        x: "level".to_owned(),
    }
}
