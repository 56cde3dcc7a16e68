//! Second moment of the windows. Its principal directions are the initial weights of the shortcut,
//! and the weights of the PCA code that serves as the network's baseline.

use crate::dataset::Dataset;
use nalgebra::DMatrix;

/// Number of windows that are multiplied as one matrix.
const BLOCK: usize = 512;

/// Returns the second-moment matrix of the dataset's windows that start half a window apart. It
/// serves as the covariance, because the band-pass removes the mean; without subtracting a mean,
/// the code of a window of zeros is exactly 0.
pub(crate) fn second_moment(dataset: &Dataset) -> DMatrix<f64> {
    let windows = dataset.aligned(dataset.dimensions().steps / 2);
    let features = dataset.dimensions().window_electrodes();
    let mut moment = DMatrix::zeros(features, features);
    for block in windows.chunks(BLOCK) {
        let columns = DMatrix::from_iterator(
            features,
            block.len(),
            block.iter().flat_map(|window| window.iter().map(|&value| f64::from(value))),
        );
        moment.gemm(1.0, &columns, &columns.transpose(), 1.0);
    }
    let count = windows.len().max(1) as f64;
    moment / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

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
