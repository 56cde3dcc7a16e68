//! Max-pool and unpooling in burn's tensors.
//!
//! burn 0.22 has no three-dimensional max-pool; taking the maximum along one axis after the other
//! is equivalent.

use artifact::{CONV2_CHANNELS, Geometry, NetworkShape, Padding};
use burn_tensor::{Device, Int, Tensor, TensorData};

/// Padding and pool of every network that this crate trains.
pub(crate) const NETWORK: NetworkShape = NetworkShape {
    padding: Padding::None,
    pool: [2, 2, 2],
};
/// Sizes between the layers of every network that this crate trains.
pub(crate) const GEOMETRY: Geometry = Geometry::new(&NETWORK);

/// Returns the 2x2x2 max-pool of a feature map, flattened: channel, step, row, column.
pub(crate) fn max_pool(x: Tensor<5>) -> Tensor<2> {
    let [count, channels, steps, rows, columns] = x.dims();
    // Rows and columns that do not fill a pool are dropped.
    let (rows, even) = (rows / 2 * 2, columns / 2 * 2);
    let x = x.slice([0..count, 0..channels, 0..steps, 0..rows, 0..even]);
    let planes = count * channels;
    let x = largest_of_pairs(x.reshape([planes * steps / 2, 2, rows * even]));
    let x = largest_of_pairs(x.reshape([planes * steps / 2 * rows / 2, 2, even]));
    let x = largest_of_pairs(x.reshape([planes * steps / 2 * rows / 2 * even / 2, 2, 1]));
    x.reshape([count, GEOMETRY.flat()])
}

/// Returns the maximum over the middle axis, which has two elements.
fn largest_of_pairs(x: Tensor<3>) -> Tensor<3> {
    let [outer, _, inner] = x.dims();
    let first = x.clone().slice([0..outer, 0..1, 0..inner]);
    first.max_pair(x.slice([0..outer, 1..2, 0..inner]))
}

/// Unpools to the feature map by nearest neighbour. For example, columns 0 to 2 of the five take pooled
/// column 0, and columns 3 and 4 take pooled column 1.
pub(crate) fn unpool(flat: Tensor<2>) -> Tensor<5> {
    let (count, device) = (flat.dims()[0], flat.device());
    let [steps, rows, columns] = GEOMETRY.pooled;
    let mut x = flat.reshape([count, CONV2_CHANNELS, steps, rows, columns]);
    for axis in 0..3 {
        let (length, pooled) = (GEOMETRY.feature_map[axis], GEOMETRY.pooled[axis]);
        let from: Vec<usize> = (0..length).map(|at| at * pooled / length).collect();
        x = x.select(axis + 2, indices(&from, &device));
    }
    x
}

/// Converts indices to a tensor of integers on `device`.
pub(crate) fn indices(values: &[usize], device: &Device) -> Tensor<1, Int> {
    let index = |&value: &usize| i64::try_from(value).expect("an index into a window");
    let values: Vec<i64> = values.iter().map(index).collect();
    let count = values.len();
    Tensor::from_data(TensorData::new(values, [count]), device)
}

/// Returns the elements of a tensor, last dimension fastest.
pub(crate) fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor
        .into_data_as::<f32>()
        .try_into_vec()
        .expect("converted to f32")
}
