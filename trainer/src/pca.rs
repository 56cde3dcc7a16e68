//! Principal directions of the windows: the start of the shortcut, and the peer of the network.

use crate::dataset::Dataset;
use nalgebra::{DMatrix, SymmetricEigen};

/// Time steps from one window to the next in the second moment: half a window.
const HOP: usize = 8;
/// Windows that enter one matrix product.
const BLOCK: usize = 512;

/// The second moment of the dataset's windows, f64. Not the covariance: the band-pass leaves no
/// mean, and without one the code of silence is 0.
pub fn second_moment(dataset: &Dataset) -> DMatrix<f64> {
    let windows = dataset.aligned(HOP);
    let features = artifact::WINDOW_ELECTRODES;
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
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 windows")]
    let count = windows.len().max(1) as f64;
    moment / count
}

/// The `count` orthonormal directions along which a second moment is largest, the largest first.
///
/// Of a direction and its negative, the one whose largest element is positive; so that the same
/// data give the same signs.
///
/// # Panics
/// When the matrix has fewer than `count` rows.
pub fn principal_directions(moment: DMatrix<f64>, count: usize) -> Vec<Vec<f32>> {
    assert!(
        count <= moment.nrows(),
        "no more directions than dimensions"
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
    use artifact::ELECTRODES;
    use nalgebra::DVector;

    #[test]
    fn the_directions_of_a_known_matrix_come_in_falling_order() {
        // Eigenvalues 1 and 4 in a plane turned by 30 degrees, and 2 across it.
        let (sin, cos) = std::f64::consts::FRAC_PI_6.sin_cos();
        let turn = DMatrix::from_row_slice(3, 3, &[cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0]);
        let scale = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 4.0, 2.0]));
        let directions = principal_directions(&turn * scale * turn.transpose(), 2);
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
        let mut steps = vec![[0.0; ELECTRODES]; 16];
        steps[2][3] = 2.0;
        steps[5][7] = -3.0;
        let moment = second_moment(&Dataset::of(vec![steps]));
        let (a, b) = (2 * ELECTRODES + 3, 5 * ELECTRODES + 7);
        assert!((moment[(a, b)] + 6.0).abs() < 1e-12);
        assert!((moment[(b, b)] - 9.0).abs() < 1e-12);
        assert!((moment.sum() - (4.0 + 9.0 - 12.0)).abs() < 1e-12);
    }
}
