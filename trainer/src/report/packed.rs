//! Rate and error of the packed model, beside the codes of the network and of PCA.

use super::writer::{MSE, Report};
use crate::code_comparison::CodeComparison;
use crate::comparison::Comparison;
use crate::error::TrainerError;
use crate::packed::RateFigures;
use crate::truncation::TruncationError;
use picture::axis::{Axis, Scale};
use picture::canvas::{INK, REFERENCE, RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};
use std::fmt::Write as _;

/// Adds the figures of all rates, and their picture.
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
    let head = [
        "rate",
        "bits of a hop",
        "longest, bytes",
        "MSE at once",
        "MSE a block later",
        "correlation of power, 8-13 Hz",
        "13-30 Hz",
    ];
    let rows = packed.iter().map(|figures| {
        vec![
            figures.rate.to_string(),
            format!("{:.1}", figures.bits),
            figures.longest.to_string(),
            format!("{:.5}", figures.mse),
            format!("{:.5}", figures.mse_smoothed),
            format!("{:.3}", figures.band_correlation[0]),
            format!("{:.3}", figures.band_correlation[1]),
        ]
    });
    std::iter::once(head.map(str::to_owned).to_vec())
        .chain(rows)
        .collect()
}

fn lines(comparison: &Comparison) -> Lines {
    let point = |figures: &RateFigures| (figures.bits, figures.mse);
    let packed = |label: &str, mark| Series {
        label: label.to_owned(),
        color: SOURCE,
        mark,
        points: comparison.packed.iter().map(point).collect(),
        sd: Vec::new(),
    };
    let codes = comparison.codes.as_ref();
    let mut series = codes.map_or_else(Vec::new, pca);
    if !comparison.without_prediction.is_empty() {
        series.push(Series {
            label: "KLT, entropy-coded".to_owned(),
            color: REFERENCE,
            mark: Mark::ThinLine,
            points: comparison
                .without_prediction
                .iter()
                .map(|figures| (figures.bits, figures.mse))
                .collect(),
            sd: Vec::new(),
        });
    }
    series.push(packed("packed code", Mark::Line));
    series.push(packed("", Mark::Dots));
    let rate = comparison.packed_rate;
    let of_rate = comparison.packed.iter();
    series.extend(rate.map(|rate| {
        Series {
            label: format!("packed code at the model's rate, {rate}"),
            color: INK,
            mark: Mark::Rings,
            points: of_rate
                .filter(|figures| figures.rate == rate)
                .map(point)
                .collect(),
            sd: Vec::new(),
        }
    }));
    series.extend(codes.map(|codes| Series {
        label: format!("network, {} codes", codes.network.format),
        color: INK,
        mark: Mark::Dots,
        points: vec![(bits(codes, codes.numbers), codes.network.integer.mse)],
        sd: Vec::new(),
    }));
    Lines {
        title: "Packed code: rate and error".to_owned(),
        subtitle: format!(
            "model {}, on {}",
            comparison.model,
            comparison.recordings.join(", ")
        ),
        x: Axis::new("bits of a hop".to_owned(), Scale::Logarithmic),
        y: Axis::new(MSE, Scale::Logarithmic),
        series,
    }
}

/// Returns the curves of PCA with fewer numbers; none without PCA.
fn pca(codes: &CodeComparison) -> Vec<Series> {
    if codes.pca_by_numbers.is_empty() {
        return Vec::new();
    }
    let curve = |label: String, (color, mark), error: fn(&TruncationError) -> f64| Series {
        label,
        color,
        mark,
        points: codes
            .pca_by_numbers
            .iter()
            .map(|at| (bits(codes, at.numbers), error(at)))
            .collect(),
        sd: Vec::new(),
    };
    let format = codes.network.format;
    vec![
        curve(format!("PCA, {format} codes"), (RESULT, Mark::Line), |at| {
            at.mse_int8
        }),
        curve("PCA, float codes".to_owned(), (INK, Mark::ThinLine), |at| {
            at.mse_float
        }),
    ]
}

/// Returns the bits of a code with this number of numbers.
fn bits(codes: &CodeComparison, numbers: usize) -> f64 {
    f64::from(u32::try_from(codes.bits_of(numbers)).unwrap_or(u32::MAX))
}

/// Returns one line for each rate, one for each number of numbers of PCA, and one for the network. A code has no
/// second error; the band powers of PCA are those of all its numbers.
fn csv(comparison: &Comparison) -> String {
    let mut text = "model,rate,numbers,bits_per_hop,mse,mse_a_block_later,\
                    band_correlation_8_13,band_correlation_13_30\n"
        .to_owned();
    // Writing to a string never fails.
    for figures in &comparison.packed {
        let RateFigures {
            rate,
            bits,
            mse,
            mse_smoothed,
            band_correlation: [alpha, beta],
            ..
        } = figures;
        let _ = writeln!(
            text,
            "packed,{rate},,{bits},{mse},{mse_smoothed},{alpha},{beta}"
        );
    }
    for figures in &comparison.without_prediction {
        let (rate, bits, mse) = (figures.rate, figures.bits, figures.mse);
        let _ = writeln!(text, "KLT,{rate},,{bits},{mse},,,");
    }
    let Some(codes) = &comparison.codes else {
        return text;
    };
    for at in &codes.pca_by_numbers {
        let bits = codes.bits_of(at.numbers);
        let bands = match codes.pca_bands {
            Some([alpha, beta]) if at.numbers == codes.numbers => format!("{alpha},{beta}"),
            _ => ",".to_owned(),
        };
        let _ = writeln!(text, "PCA,,{},{bits},{},,{bands}", at.numbers, at.mse_int8);
    }
    let (bits, mse) = (codes.bits_per_window(), codes.network.integer.mse);
    let [alpha, beta] = codes.network_bands;
    let _ = writeln!(
        text,
        "network,,{},{bits},{mse},,{alpha},{beta}",
        codes.numbers
    );
    text
}
