//! Part of a report: rate and error of the packed model, and of the codes of network and PCA.

use super::{MSE, Report};
use crate::comparison::Comparison;
use crate::error::TrainerError;
use crate::evaluate::Evaluation;
use crate::packed::cells;
use packed_fit::RateFigures;
use picture::axis::{Axis, Scale};
use picture::canvas::{INK, REFERENCE, RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};
use std::fmt::Write as _;

/// Adds the packed model's figures at all rates to a report, as a table and as a picture.
pub(super) fn add(report: &mut Report, comparison: &Comparison) -> Result<(), TrainerError> {
    report.page.push_table(&table(&comparison.packed));
    let lines = lines(comparison);
    let klt = if comparison.without_prediction.is_empty() {
        " These are not the recordings of the model's card, so the KLT of the card is not drawn."
    } else {
        " KLT is the same transform code without prediction, from the model's card."
    };
    let codes = match comparison.codes {
        Some(_) => " Codes of network and PCA are sent once a hop.",
        None => "",
    };
    report.add_picture(
        "packed",
        |path| lines.draw(path),
        &format!(
            "Error at once by bits of a hop of {} steps. The packed code has a dot for each rate, from 15 on the left to 0 \
             on the right.{klt}{codes}",
            comparison.hop
        ),
        &csv(comparison),
    )
}

fn table(packed: &[RateFigures]) -> Vec<Vec<String>> {
    let head = ["rate", "bits of a hop", "longest, bytes", "MSE at once", "MSE a block later"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(packed.iter().map(|figures| cells(figures).to_vec()));
    rows
}

fn lines(comparison: &Comparison) -> Lines {
    let point = |figures: &RateFigures| (figures.bits, figures.mse);
    let packed = |label, mark| {
        let points = comparison.packed.iter().map(point);
        Series::new(label, SOURCE, mark, points.collect())
    };
    let codes = comparison.codes.as_ref();
    let mut series = Vec::new();
    if !comparison.without_prediction.is_empty() {
        let points = comparison.without_prediction.iter();
        let points = points.map(|figures| (figures.bits, figures.mse)).collect();
        let klt = Series::new("KLT, entropy-coded", REFERENCE, Mark::ThinLine, points);
        series.push(klt);
    }
    series.push(packed("packed code", Mark::Line));
    series.push(packed("", Mark::Dots));
    if let Some(rate) = comparison.packed_rate {
        let label = format!("packed code at the model's rate, {rate}");
        let figures = comparison.packed.iter();
        let points = figures.filter(|figures| figures.rate == rate).map(point);
        series.push(Series::new(label, INK, Mark::Rings, points.collect()));
    }
    if let Some(codes) = codes {
        let bits = f64::from(u32::try_from(codes.bits_per_window()).unwrap_or(u32::MAX));
        let mut add = |model: &str, color, errors: &Evaluation| {
            let label = format!("{model}, {} codes", errors.format);
            let point = (bits, errors.integer.mse);
            series.push(Series::new(label, color, Mark::Dots, vec![point]));
        };
        if let Some(pca) = &codes.pca {
            add("PCA", RESULT, pca);
        }
        add("network", INK, &codes.network);
    }
    Lines {
        title: "Packed code: rate and error".to_owned(),
        subtitle: format!("model {}, on {}", comparison.model, comparison.recordings.join(", ")),
        x: Axis::new("bits of a hop".to_owned(), Scale::Logarithmic),
        y: Axis::new(MSE, Scale::Logarithmic),
        series,
    }
}

/// Returns the values of the packed picture as CSV: a line for each rate, for each rate without
/// prediction (KLT), for PCA and for the network. Only the packed code has a value for the error
/// one block later.
fn csv(comparison: &Comparison) -> String {
    let mut text = "model,rate,numbers,bits_per_hop,mse,mse_a_block_later\n".to_owned();
    for figures in &comparison.packed {
        let RateFigures { rate, bits, mse, mse_smoothed, .. } = figures;
        let _ = writeln!(text, "packed,{rate},,{bits},{mse},{mse_smoothed}");
    }
    for figures in &comparison.without_prediction {
        let (rate, bits, mse) = (figures.rate, figures.bits, figures.mse);
        let _ = writeln!(text, "KLT,{rate},,{bits},{mse},");
    }
    let Some(codes) = &comparison.codes else {
        return text;
    };
    let (numbers, bits) = (codes.numbers, codes.bits_per_window());
    let pca = codes.pca.iter().map(|errors| ("PCA", errors));
    for (model, errors) in pca.chain([("network", &codes.network)]) {
        let mse = errors.integer.mse;
        let _ = writeln!(text, "{model},,{numbers},{bits},{mse},");
    }
    text
}
