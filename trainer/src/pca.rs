//! Principal directions of the windows: the initial weights of the shortcut, and the weights of the
//! PCA code with which the network is compared.

use crate::dataset::Dataset;
use nalgebra::{DMatrix, SymmetricEigen};

/// Number of windows that are multiplied as one matrix.
const BLOCK: usize = 512;

/// Returns the second-moment matrix of the dataset's windows that start half a window apart. It
/// replaces the covariance: the band-pass removes the mean anyway, and because no mean is
/// subtracted, the code of a zero window is 0.
pub(crate) fn second_moment(dataset: &Dataset) -> DMatrix<f64> {
    let windows = dataset.aligned(dataset.dimensions().steps / 2);
    let features = dataset.dimensions().window_electrodes();
    let mut moment = DMatrix::zeros(features, features);
    for block in windows.chunks(BLOCK) {
        let columns = DMatrix::from_iterator(
            features,
            block.len(),
            block
                .iter()
                .flat_map(|window| window.iter().map(|&value| f64::from(value))),
        );
        moment.gemm(1.0, &columns, &columns.transpose(), 1.0);
    }
    let count = windows.len().max(1) as f64;
    moment / count
}

/// Returns the `count` orthonormal directions with the largest second moment, largest first.
///
/// The sign of each direction is such that its element of largest magnitude is positive. So the
/// same data always yield the same signs.
///
/// # Panics
/// If the matrix has fewer than `count` rows.
pub(crate) fn principal_directions(moment: DMatrix<f64>, count: usize) -> Vec<Vec<f32>> {
    assert!(
        count <= moment.nrows(),
        "there are at most as many directions as dimensions"
    );
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
    use crate::testing;
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

    #[test]
    fn the_second_moment_is_the_mean_of_outer_products() {
        let dimensions = testing::description().dimensions();
        let (a, b) = (2 * dimensions.electrodes + 3, 5 * dimensions.electrodes + 7);
        let mut values = vec![0.0; dimensions.window_electrodes()];
        (values[a], values[b]) = (2.0, -3.0);
        let moment = second_moment(&Dataset::from_segments(vec![values], dimensions));
        assert!((moment[(a, b)] + 6.0).abs() < 1e-12);
        assert!((moment[(b, b)] - 9.0).abs() < 1e-12);
        assert!((moment.sum() - (4.0 + 9.0 - 12.0)).abs() < 1e-12);
    }
}
