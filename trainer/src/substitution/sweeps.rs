//! The sweeps with which a device substitutes several bad electrodes at once.
//!
//! A sweep replaces each bad electrode in turn by its prediction from the others, where the other
//! bad electrodes have their latest values (Gauss-Seidel). With the exact weights, sweeps converge
//! for every set of bad electrodes, because the inverse of a covariance is positive definite. With
//! rounded and clipped weights, they may not.

use crate::error::TrainerError;
use artifact::{Description, ScalpGrid, SubstitutionTable};
use nalgebra::DMatrix;
use packed_fit::Track;
use rand::SeedableRng;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

/// Largest number of electrodes that a device substitutes at the same time.
const MOST: usize = 12;

/// Number of sweeps over the bad electrodes, as on a device.
const SWEEPS: usize = 8;

/// Number of times that a sweep's matrix is squared to find the matrix's spectral radius.
const SQUARINGS: u32 = 10;

/// Returns the largest spectral radius of a sweep over 12 electrodes or, in a montage of 12 or
/// fewer, over all electrodes but one. The radius is the factor by which a late sweep reduces the
/// distance to the limit. The sweeps are over the neighbours of each electrode on the scalp grid,
/// and over twice as many random sets.
///
/// # Errors
/// If the sweeps over a set of electrodes do not converge; the error names these electrodes.
pub(crate) fn largest_radius(
    table: &SubstitutionTable,
    description: &Description,
) -> Result<f64, TrainerError> {
    let labels = &description.montage.electrodes;
    let columns = description.dimensions().columns;
    let grid = ScalpGrid::new(description);
    let place = |electrode: usize| {
        let cell = grid.cell_of_electrode()[electrode];
        [cell / columns, cell % columns]
    };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut largest = 0.0_f64;
    for index in 0..3 * labels.len() {
        let mut set: Vec<usize> = (0..labels.len()).collect();
        if index < labels.len() {
            let [row, column] = place(index);
            set.sort_by_key(|&other| {
                let [other_row, other_column] = place(other);
                row.abs_diff(other_row).pow(2) + column.abs_diff(other_column).pow(2)
            });
        } else {
            set.shuffle(&mut rng);
        }
        set.truncate(MOST.min(labels.len() - 1));
        set.sort_unstable();
        let radius = spectral_radius(&table.weights, labels.len(), &set);
        if radius >= 1.0 {
            let labels = set.iter().map(|&electrode| labels[electrode].clone());
            return Err(TrainerError::NoConvergence { labels: labels.collect(), radius });
        }
        largest = largest.max(radius);
    }
    Ok(largest)
}

/// Returns a recording in which the bad electrodes, the first 12 if there are more, have the values
/// with which a device fills them. The computation uses floats; the device uses integers in units
/// of a quarter of a microvolt.
pub(crate) fn filled(track: &Track, table: &SubstitutionTable) -> Track {
    let mut filled = track.clone();
    let bad = &track.bad[..track.bad.len().min(MOST)];
    for step in filled.values.chunks_exact_mut(track.electrodes) {
        for &electrode in bad {
            step[electrode] = 0.0;
        }
        for &electrode in bad.iter().cycle().take(SWEEPS * bad.len()) {
            let weights = &table.weights[electrode * step.len()..][..step.len()];
            let products = weights.iter().zip(&*step);
            let sum: f32 = products.map(|(&weight, x)| f32::from(weight) * x).sum();
            step[electrode] = sum / 128.0;
        }
    }
    filled
}

/// Returns the spectral radius of a sweep over a set of electrodes.
///
/// With the weights `L + U` between the electrodes of the set (below and above the diagonal), a
/// sweep multiplies the distance to the limit by `M = (I - L)^-1 U`. The radius is the limit of
/// `|M^n|^(1/n)` (Gelfand), here with n = 2^10.
fn spectral_radius(weights: &[i8], electrodes: usize, set: &[usize]) -> f64 {
    let size = set.len();
    let weight = |row: usize, column: usize| weights[set[row] * electrodes + set[column]];
    let coupling =
        DMatrix::from_fn(size, size, |row, column| f64::from(weight(row, column)) / 128.0);
    let above = coupling.upper_triangle();
    // The triangle has ones on its diagonal, so there is always a solution.
    let triangle = DMatrix::identity(size, size) - coupling.lower_triangle();
    let mut power = triangle.solve_lower_triangular(&above).unwrap_or(above);
    let mut logarithm = power.norm().ln();
    for squaring in 1..=SQUARINGS {
        power /= power.norm().max(f64::MIN_POSITIVE);
        power = &power * &power;
        logarithm += power.norm().ln() / f64::from(1 << squaring);
    }
    logarithm.exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_radius_is_that_of_the_sweep_s_eigenvalues() {
        // Of the five electrodes, 1 and 4 are swept. With the weights a and b between them, M has
        // the eigenvalues 0 and a * b, because the second electrode's new value follows from the
        // first's.
        let mut weights = vec![1; 25];
        for electrode in 0..5 {
            weights[electrode * 6] = 0;
        }
        for [a, b] in [[127, 127], [-64, 64], [3, -127], [0, 5]] {
            (weights[5 + 4], weights[4 * 5 + 1]) = (a, b);
            let expected = (f64::from(a) * f64::from(b)).abs() / 128.0_f64.powi(2);
            let radius = spectral_radius(&weights, 5, &[1, 4]);
            assert!((radius - expected).abs() <= 2e-3 * expected, "{radius}");
        }
    }

    #[test]
    fn bad_electrodes_are_the_solution_of_their_equations() {
        let mut weights = vec![20, -30, 45, 60, 10];
        weights = weights.into_iter().cycle().take(25).collect();
        for electrode in 0..5 {
            weights[electrode * 6] = 0;
        }
        let table = SubstitutionTable {
            description: artifact::SubstitutionDescription {
                format: 1,
                training: artifact::SubstitutionTraining::default(),
            },
            weights,
            innovation: vec![1; 5],
        };
        let mut track = Track::new("five", 5, vec![8.0, -3.0, 5.0, 1.0, 900.0]);
        track.bad = vec![4, 1];
        let values = filled(&track, &table).values;
        // x1 = (20 * 8 + 45 * 5 + 60 * 1 + 10 * x4) / 128, x4 = (20 * 8 - 30 * x1 + 45 * 5 + 60) /
        // 128
        let [a, b] = [445.0 / 128.0, 10.0 / 128.0];
        let x1 = (a + b * a) / (1.0 + b * 30.0 / 128.0);
        let x4 = a - 30.0 / 128.0 * x1;
        for (value, expected) in values.iter().zip([8.0, x1, 5.0, 1.0, x4]) {
            assert!((value - expected).abs() < 1e-4, "{values:?} {x1} {x4}");
        }
    }

    #[test]
    fn a_table_that_does_not_converge_is_refused_with_its_electrodes() {
        let description = crate::testing::description();
        let mut table =
            any_model::any_artifact(1, artifact::Mode::Pca, artifact::Padding::None, [2, 2, 2], 8)
                .unwrap()
                .substitution
                .unwrap();
        let radius = largest_radius(&table, &description).unwrap();
        assert!((0.1..1.0).contains(&radius), "{radius}");
        // Electrodes 17, 18 and 19 are neighbours, and predict each other with weights of nearly 1.
        for (electrode, other) in [(17, 18), (18, 17), (17, 19), (19, 17), (18, 19), (19, 18)] {
            table.weights[electrode * 61 + other] = 127;
        }
        let error = largest_radius(&table, &description).unwrap_err();
        let TrainerError::NoConvergence { labels, radius } = &error else { panic!("{error}") };
        let near = [17, 18, 19].map(|electrode| &description.montage.electrodes[electrode]);
        assert!(near.iter().filter(|label| labels.contains(label)).count() > 1, "{error}");
        assert!(labels.len() == 12 && *radius > 1.0, "{error}");
    }
}
