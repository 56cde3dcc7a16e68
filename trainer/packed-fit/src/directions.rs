//! Second moments of signals, and their principal directions.

use nalgebra::{DMatrix, SymmetricEigen};

/// Returns the second moment: the mean, over all columns, of the column's outer product with
/// itself.
pub fn second_moment(sequences: &[DMatrix<f32>]) -> DMatrix<f64> {
    let rows = sequences.first().map_or(0, DMatrix::nrows);
    let mut moment = DMatrix::zeros(rows, rows);
    for columns in sequences {
        let columns = columns.map(f64::from);
        moment.gemm(1.0, &columns, &columns.transpose(), 1.0);
    }
    let count: usize = sequences.iter().map(DMatrix::ncols).sum();
    let count = count.max(1) as f64;
    moment / count
}

/// Returns the `count` orthonormal directions with the largest second moment, largest first.
///
/// The sign of each direction is chosen so that its element of largest magnitude is positive. The
/// same data therefore always yield the same signs.
///
/// # Panics
/// If the matrix has fewer than `count` rows.
pub fn principal_directions(moment: DMatrix<f64>, count: usize) -> Vec<Vec<f32>> {
    assert!(count <= moment.nrows(), "there are at most as many directions as dimensions");
    let eigen = SymmetricEigen::new(moment);
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let direction = |&index: &usize| {
        let vector = eigen.eigenvectors.column(index);
        let sign = vector[vector.iamax()].signum();
        #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
        vector.iter().map(|value| (value * sign) as f32).collect()
    };
    order.iter().take(count).map(direction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn the_directions_of_a_known_matrix_are_in_descending_order() {
        // The matrix has the eigenvalues 1 and 4 in a plane rotated by 30 degrees, and the
        // eigenvalue 2 perpendicular to this plane.
        let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
        let rotation =
            DMatrix::from_row_slice(3, 3, &[cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0]);
        let scale = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 4.0, 2.0]));
        let directions = principal_directions(&rotation * scale * rotation.transpose(), 2);
        #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
        let expected = [[-sin as f32, cos as f32, 0.0], [0.0, 0.0, 1.0]];
        for (direction, expected) in directions.iter().zip(expected) {
            for (value, expected) in direction.iter().zip(expected) {
                assert!((value - expected).abs() < 1e-6, "{directions:?}");
            }
        }
    }
}
