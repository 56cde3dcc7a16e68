//! Part of a report: figures of an evaluation, and the error of each electrode.

use super::Report;
use crate::comparison::{CodeComparison, Comparison};
use crate::electrode_error::ElectrodeError;
use crate::error::TrainerError;
use artifact::Mode;
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
        super::people::add(report, &comparison.people)?;
    }
    if !comparison.packed.is_empty() {
        super::packed::add(report, comparison)?;
    }
    Ok(())
}

fn figures(mode: Mode, codes: &CodeComparison) -> Vec<Vec<String>> {
    let head = ["model", "codes", "bits per window", "MSE", "MSE, uV²", "PRD"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (name, errors) in codes.models(&mode.to_string(), mode) {
        let bits = codes.bits_per_window().to_string();
        let format = errors.format.to_string();
        for (format, bits, error) in
            [("float".to_owned(), String::new(), errors.float), (format, bits, errors.integer)]
        {
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

/// Returns the positions of electrodes on the map of the head, from their labels or, if a label has
/// no position in the 10-20 system, from their cells of the scalp grid.
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
            /// Largest distance of a cell from the centre along each side of the map. It is so
            /// small that the corners of the grid are on the head.
            const REACH: f64 = 0.65;
            let part = cell as f64 / largest.max(1) as f64;
            if largest == 0 { 0.0 } else { REACH * (2.0 * part - 1.0) }
        };
        let place = |cell: [usize; 2]| [on_side(cell[1], columns), -on_side(cell[0], rows)];
        cells.map(place).collect()
    })
}

/// Returns the label of each electrode, and row and column of its cell on the scalp grid.
pub(super) fn cells(errors: &[ElectrodeError]) -> impl Iterator<Item = (&str, [usize; 2])> + Clone {
    errors.iter().map(|error| (error.label.as_str(), error.cell))
}

fn electrodes_csv(codes: &CodeComparison, sd_uv: f64) -> String {
    let mut text =
        "electrode,row,column,origin,mse_float,mse_int8,mse_uv2_float,mse_uv2_int8\n".to_owned();
    let unit = sd_uv.powi(2);
    for error in &codes.electrode_errors {
        let ElectrodeError { label, cell: [row, column], is_recorded, mse_float, mse_int8 } = error;
        let origin = if *is_recorded { "measured" } else { "interpolated" };
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
        for (place, expected) in places.iter().zip([[0.0, 0.65], [-0.65, 0.65], [0.65, -0.65]]) {
            let distance = (place[0] - expected[0]).hypot(place[1] - expected[1]);
            assert!(distance < 1e-9, "{place:?} is not {expected:?}");
        }
    }
}
