//! Fits a table of substitutions to filtered recordings, and measures its errors on recordings.

use crate::card::interpolated;
use crate::error::TrainerError;
use artifact::{SubstitutionFigures, SubstitutionTable};
use nalgebra::DMatrix;
use packed_fit::innovation::{SECOND, columns, median, prediction, residual, seconds};
use packed_fit::{FitError, Track};

/// Integer that represents a weight of 1: weights are Q7.
const ONE: f64 = 128.0;

/// Smallest and largest typical energy of an innovation, relative to the median of all electrodes'
/// typical energies. The limits make a device judge an electrode that was bad in training nearly as
/// strictly as the others.
const SPREAD: [f64; 2] = [0.25, 9.0];

/// Number of units of an innovation's energy, (1/16 uV)^2 each, in 1 uV^2.
const UNITS_PER_UV2: f64 = 256.0;

/// Returns the weights of [`prediction`] in Q7, -127..=127, `[electrode][other electrode]`.
///
/// # Errors
/// If the recordings have fewer seconds than electrodes, or all electrodes are 0.
pub(super) fn weights(tracks: &[Track], electrodes: usize) -> Result<Vec<i8>, TrainerError> {
    let seconds = tracks.iter().map(|track| track.steps() / SECOND).sum();
    if seconds < electrodes {
        return Err(TrainerError::TooFewSeconds { seconds, electrodes });
    }
    let prediction = prediction(tracks).ok_or(FitError::Silent)?;
    let weight = |index: usize| {
        let weight = prediction[(index / electrodes, index % electrodes)];
        #[expect(clippy::cast_possible_truncation, reason = "clamped to 8 bits")]
        let weight = (weight * ONE).round().clamp(-127.0, 127.0) as i8;
        weight
    };
    Ok((0..electrodes * electrodes).map(weight).collect())
}

/// Returns the typical mean square of each electrode's innovation, in (1/16 uV)^2, at least 1: the
/// median over all seconds, limited to the range [`SPREAD`] times the median electrode's value.
pub(super) fn innovation(weights: &[i8], tracks: &[Track]) -> Vec<i32> {
    let electrodes = weights.len().isqrt();
    let mut energies = vec![Vec::new(); electrodes];
    for track in tracks {
        let innovations = innovations(weights, track);
        for (row, energies) in innovations.row_iter().zip(&mut energies) {
            energies.extend(seconds(row.iter()));
        }
    }
    let medians: Vec<f64> = energies.into_iter().map(median).collect();
    let [least, most] = SPREAD.map(|factor| factor * median(medians.clone()));
    #[expect(
        clippy::cast_possible_truncation,
        reason = "saturates above the largest value that an artifact accepts"
    )]
    let units = |uv2: f64| ((uv2.clamp(least, most) * UNITS_PER_UV2).round() as i32).max(1);
    medians.into_iter().map(units).collect()
}

/// Returns the errors of a table of substitutions on recordings, over the electrodes that all
/// recordings have; `None` if there is no such electrode.
pub(super) fn figures(
    table: &SubstitutionTable,
    tracks: &[Track],
    electrodes: &[String],
) -> Option<SubstitutionFigures> {
    let mut energies = vec![[0.0; 2]; electrodes.len()];
    for track in tracks {
        let (innovations, steps) = (innovations(&table.weights, track), columns(track));
        let rows = innovations.row_iter().zip(steps.row_iter());
        for ((innovations, row), energies) in rows.zip(&mut energies) {
            energies[0] += innovations.norm_squared();
            energies[1] += row.map(f64::from).norm_squared();
        }
    }
    let interpolated = interpolated(electrodes, tracks);
    let errors = electrodes.iter().zip(energies).filter(|(label, _)| !interpolated.contains(label));
    let errors = errors.map(|(label, [innovation, signal])| (innovation / signal, label));
    let errors: Vec<(f64, &String)> = errors.collect();
    let (worst, label) = errors.iter().max_by(|(a, _), (b, _)| a.total_cmp(b))?;
    let rounded = |error: f64| (error * 1e6).round() / 1e6;
    Some(SubstitutionFigures {
        median_nmse: rounded(median(errors.iter().map(|(error, _)| *error).collect())),
        worst_nmse: rounded(*worst),
        worst_electrode: (*label).clone(),
    })
}

/// Returns the electrodes' values minus their predictions by the weights of a table, uV,
/// `[electrode, step]`.
fn innovations(weights: &[i8], track: &Track) -> DMatrix<f64> {
    let weights = weights.iter().map(|&weight| f64::from(weight) / ONE);
    let weights = DMatrix::from_row_iterator(track.electrodes, track.electrodes, weights);
    residual(&weights, track)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use artifact::SubstitutionDescription;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const LABELS: [&str; 8] = ["A", "B", "C", "D", "E", "F", "G", "H"];

    /// Returns tracks of mixed sources. Electrode H has much noise of its own, A hardly any, and B
    /// has a large amplitude. Every other second has three times the amplitude.
    fn tracks() -> [Track; 3] {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        [700, 1500, 999].map(|steps| {
            let values = (0..steps).flat_map(|step| {
                let gain = [10.0, 30.0][step / SECOND % 2];
                let sources: [f32; 3] = std::array::from_fn(|_| rng.random_range(-gain..gain));
                let mut electrodes: [f32; 8] = std::array::from_fn(|at| {
                    let noise = [0.1, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 20.0][at];
                    sources[at % 3] - sources[at / 3] / 2.0 + rng.random_range(-noise..noise)
                });
                electrodes[1] *= 4.0;
                electrodes
            });
            Track::new("mixed", 8, values.collect())
        })
    }

    #[test]
    fn numpy_computes_the_same_table_and_errors() {
        let tracks = tracks();
        let program = include_str!("reference.py");
        let numpy = testing::numpy("table of substitutions", program, &[], tracks.iter());
        let Some(numpy) = numpy else {
            return;
        };
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let weights = weights(&tracks, 8).unwrap();
        assert_eq!(serde_json::json!(weights), numpy["weights"]);
        assert!(weights.contains(&127), "{weights:?}");
        let innovation = innovation(&weights, &tracks);
        for (index, units) in innovation.iter().enumerate() {
            let difference = f64::from(*units) - number(&numpy["innovation"][index]);
            assert!(difference.abs() < 0.501, "{innovation:?} {numpy}");
        }
        // The innovation of H is limited to the upper end of `SPREAD`, and the innovation of A to
        // the lower end.
        assert!((f64::from(innovation[7]) / f64::from(innovation[0]) - 36.0).abs() < 0.5);
        let table = SubstitutionTable {
            description: SubstitutionDescription::default(),
            weights,
            innovation,
        };
        let figures = figures(&table, &tracks, &LABELS.map(str::to_owned)).unwrap();
        let [median, worst] = [0, 1].map(|index| number(&numpy["figures"][index]));
        assert!((figures.median_nmse - median).abs() < 1e-6, "{figures:?} {numpy}");
        assert!((figures.worst_nmse - worst).abs() < 1e-6, "{figures:?} {numpy}");
        assert_eq!(numpy["figures"][2], figures.worst_electrode.as_str());
    }
}
