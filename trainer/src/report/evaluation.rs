//! Part of a report: error of each electrode, and error of PCA with fewer numbers.

use super::{MSE, Report};
use crate::comparison::{CodeComparison, Comparison};
use crate::electrode_error::ElectrodeError;
use crate::error::TrainerError;
use crate::person_error::PersonError;
use crate::truncation::TruncationError;
use artifact::Mode;
use picture::axis::{Axis, Scale};
use picture::canvas::{INK, RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};
use picture::page::csv_field;
use picture::scalp_map::{Place, ScalpMap, on_map};
use recordings::Position;
use std::fmt::Write as _;

/// Adds figures and pictures of an evaluation to a report.
pub(super) fn add(report: &mut Report, comparison: &Comparison) -> Result<(), TrainerError> {
    let (windows, prd) = match &comparison.codes {
        Some(codes) => (
            format!("{} windows of ", codes.network.windows),
            "; PRD = 100 sqrt(sum of squared difference / sum of squared original)",
        ),
        None => (String::new(), ""),
    };
    report.page.push_text(&format!(
        "Model {}, mode {}, on {windows}{}. {} of {} electrodes were recorded. MSE is in units of the \
         training data's standard deviation ({:.2} uV) squared{prd}.",
        comparison.model,
        comparison.mode,
        comparison.recordings.join(", "),
        comparison.real_electrodes,
        comparison.electrodes,
        comparison.sd_uv
    ));
    if let Some(codes) = &comparison.codes {
        report.page.push_table(&figures(comparison.mode, codes));
        let map = scalp_map(codes, comparison.sd_uv);
        report.add_picture(
            "electrodes",
            |path| map.draw(path),
            &format!(
                "Mean squared error of each electrode with {} codes. The mean over all electrodes is \
                 the error of the model.",
                codes.network.format
            ),
            &electrodes_csv(codes, comparison.sd_uv),
        )?;
    }
    if !comparison.people.is_empty() {
        report.page.push_text(
            "Error for each person with integer codes: with the electrodes that are bad in a \
             recording filled from the others, as a device fills electrodes that it excludes, and \
             as recorded.",
        );
        report.page.push_table(&people(&comparison.people));
    }
    if !comparison.packed.is_empty() {
        super::packed::add(report, comparison)?;
    }
    let Some(codes) = &comparison.codes else {
        return Ok(());
    };
    if codes.pca_by_numbers.is_empty() {
        report.page.push_text(
            "The artifact has no pca.safetensors, so there is no picture of rate and error.",
        );
        return Ok(());
    }
    let rate = rate(comparison, codes);
    report.add_picture(
        "rate",
        |path| rate.draw(path),
        &format!(
            "Error by bits per window: PCA with the first number of its code, the first two, up to \
             all {}. Float codes are drawn at the bits of {} codes with as many numbers: the distance \
             between the two is the error of rounding.",
            codes.numbers, codes.network.format
        ),
        &rate_csv(codes),
    )
}

fn figures(mode: Mode, codes: &CodeComparison) -> Vec<Vec<String>> {
    let head = [
        "model",
        "codes",
        "bits per window",
        "MSE",
        "MSE, uV²",
        "PRD",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (name, errors) in codes.models(&mode.to_string(), mode) {
        let bits = codes.bits_per_window().to_string();
        let format = errors.format.to_string();
        for (format, bits, error) in [
            ("float".to_owned(), String::new(), errors.float),
            (format, bits, errors.integer),
        ] {
            rows.push(vec![
                name.clone(),
                format,
                bits,
                format!("{:.5}", error.mse),
                format!("{:.2}", error.mse_uv2),
                format!("{:.2} %", error.prd_percent),
            ]);
        }
    }
    rows
}

fn people(people: &[PersonError]) -> Vec<Vec<String>> {
    let head = [
        "person",
        "bad electrodes",
        "PRD, filled",
        "as recorded",
        "MSE of the good electrodes, uV²: others filled",
        "as recorded",
    ];
    let rows = people.iter().map(|error| {
        let [good_on, good_off] = error.of_good();
        [
            error.person.subject.clone(),
            error.person.bad.join(", "),
            format!("{:.2} %", error.on.all.prd_percent),
            format!("{:.2} %", error.off.all.prd_percent),
            format!("{good_on:.2}"),
            format!("{good_off:.2}"),
        ]
    });
    let rows = std::iter::once(head.map(str::to_owned)).chain(rows);
    rows.map(Vec::from).collect()
}

fn scalp_map(codes: &CodeComparison, sd_uv: f64) -> ScalpMap {
    let errors = &codes.electrode_errors;
    let unit = sd_uv.powi(2);
    let places = places(cells(errors));
    ScalpMap {
        places: errors
            .iter()
            .zip(places)
            .map(|(error, at)| Place {
                label: error.label.clone(),
                at,
                value: error.mse_int8 * unit,
                is_measured: error.is_recorded,
            })
            .collect(),
        title: "Error of each electrode".to_owned(),
        subtitle: format!(
            "mean squared error with {} codes; mean over {} electrodes: {:.2} µV²",
            codes.network.format,
            errors.len(),
            codes.network.integer.mse_uv2
        ),
        unit: "µV²".to_owned(),
    }
}

/// Returns the places of electrodes on the map of the head, from their labels and cells. The labels determine them or, if
/// a label has no place in the 10-20 system, their cells of the scalp grid.
pub(super) fn places<'a>(
    electrodes: impl Iterator<Item = (&'a str, [usize; 2])> + Clone,
) -> Vec<[f64; 2]> {
    let labelled = electrodes.clone().map(|(label, _)| {
        let Position { x, y, z } = Position::from_label(label)?;
        Some(on_map([x, y, z]))
    });
    let labelled: Option<Vec<[f64; 2]>> = labelled.collect();
    labelled.unwrap_or_else(|| {
        let cells = electrodes.map(|(_, cell)| cell);
        let largest = [0, 1].map(|side| cells.clone().map(|cell| cell[side]).max());
        let [rows, columns] = largest.map(|largest| largest.unwrap_or(0));
        let on_side = |cell: usize, largest: usize| {
            /// Largest distance of a cell from the centre along each side of the map, small enough
            /// that the corners of the grid are on the head.
            const REACH: f64 = 0.65;
            let part = cell as f64 / largest.max(1) as f64;
            if largest == 0 {
                0.0
            } else {
                REACH * (2.0 * part - 1.0)
            }
        };
        let place = |cell: [usize; 2]| [on_side(cell[1], columns), -on_side(cell[0], rows)];
        cells.map(place).collect()
    })
}

/// Returns label and cell of each electrode.
fn cells(errors: &[ElectrodeError]) -> impl Iterator<Item = (&str, [usize; 2])> + Clone {
    errors
        .iter()
        .map(|error| (error.label.as_str(), error.cell))
}

fn electrodes_csv(codes: &CodeComparison, sd_uv: f64) -> String {
    let mut text =
        "electrode,row,column,origin,mse_float,mse_int8,mse_uv2_float,mse_uv2_int8\n".to_owned();
    let unit = sd_uv.powi(2);
    for error in &codes.electrode_errors {
        let ElectrodeError {
            label,
            cell: [row, column],
            is_recorded,
            mse_float,
            mse_int8,
        } = error;
        let origin = if *is_recorded {
            "measured"
        } else {
            "interpolated"
        };
        let _ = writeln!(
            text,
            "{},{row},{column},{origin},{mse_float},{mse_int8},{},{}",
            csv_field(label),
            mse_float * unit,
            mse_int8 * unit
        );
    }
    text
}

fn rate(comparison: &Comparison, codes: &CodeComparison) -> Lines {
    let (format, model) = (codes.network.format, &codes.network);
    let at = |mse| vec![(bits(codes, codes.numbers), mse)];
    let (integer, float) = (at(model.integer.mse), at(model.float.mse));
    let label = format!("model, {format} codes");
    let mut series = pca_curves(codes);
    series.extend([
        Series::new(label, SOURCE, Mark::Dots, integer),
        Series::new("model, float codes", SOURCE, Mark::Rings, float),
    ]);
    Lines {
        title: "Rate and error".to_owned(),
        subtitle: format!(
            "model {}, mode {}: {} numbers, {} bits per window",
            comparison.model,
            comparison.mode,
            codes.numbers,
            codes.bits_per_window()
        ),
        x: Axis::new(format!("bits per window of {format} codes"), Scale::Linear),
        y: Axis::new(MSE, Scale::Logarithmic),
        series,
    }
}

/// Returns curves of the error of PCA over the bits of a code. Their points are for the first
/// number alone, the first two, up to all. Without PCA there are no curves.
pub(super) fn pca_curves(codes: &CodeComparison) -> Vec<Series> {
    if codes.pca_by_numbers.is_empty() {
        return Vec::new();
    }
    let points = |error: fn(&TruncationError) -> f64| {
        let errors = codes.pca_by_numbers.iter();
        errors
            .map(|at| (bits(codes, at.numbers), error(at)))
            .collect()
    };
    let label = format!("PCA, {} codes", codes.network.format);
    let (integer, float) = (
        points(|error| error.mse_int8),
        points(|error| error.mse_float),
    );
    vec![
        Series::new(label, RESULT, Mark::Line, integer),
        Series::new("PCA, float codes", INK, Mark::ThinLine, float),
    ]
}

/// Returns the length in bits of an integer code with `numbers` numbers, as a value on an axis.
pub(super) fn bits(codes: &CodeComparison, numbers: usize) -> f64 {
    f64::from(u32::try_from(codes.bits_of(numbers)).unwrap_or(u32::MAX))
}

/// Returns the rate picture's values as CSV: a line for each length of a PCA code, one for the
/// model.
fn rate_csv(codes: &CodeComparison) -> String {
    let mut text = "model,numbers,bits_per_window,mse_float,mse_int8\n".to_owned();
    for error in &codes.pca_by_numbers {
        let TruncationError {
            numbers,
            mse_float,
            mse_int8,
        } = error;
        let bits = codes.bits_of(*numbers);
        let _ = writeln!(text, "PCA,{numbers},{bits},{mse_float},{mse_int8}");
    }
    let _ = writeln!(
        text,
        "model,{},{},{},{}",
        codes.numbers,
        codes.bits_per_window(),
        codes.network.float.mse,
        codes.network.integer.mse
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn electrodes_are_at_the_places_of_their_labels() {
        let places = places([("Cz", [0, 0]), ("Oz", [1, 0])].into_iter());
        assert!(places[0][0].hypot(places[0][1]) < 1e-9, "the vertex");
        assert!(places[1][0].abs() < 1e-9 && places[1][1] < -0.8, "the back");
    }

    #[test]
    fn a_label_without_a_place_puts_all_electrodes_at_their_cells() {
        let places = places([("Cz", [0, 1]), ("E7", [0, 0]), ("E8", [2, 2])].into_iter());
        for (place, expected) in places
            .iter()
            .zip([[0.0, 0.65], [-0.65, 0.65], [0.65, -0.65]])
        {
            let distance = (place[0] - expected[0]).hypot(place[1] - expected[1]);
            assert!(distance < 1e-9, "{place:?} is not {expected:?}");
        }
    }
}
