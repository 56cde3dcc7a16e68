//! Max-pool and unpooling in burn's tensors.
//!
//! burn 0.22 has no three-dimensional max-pool; taking the maximum along one axis after the other
//! is equivalent.

use artifact::{CONV2_CHANNELS, Geometry};
use burn_tensor::{Device, Int, Tensor, TensorData};

/// Returns the max-pool of a feature map, flattened: channel, step, row, column.
pub(crate) fn max_pool(x: Tensor<5>, geometry: &Geometry) -> Tensor<2> {
    let [count, channels, ..] = x.dims();
    let (pooled, pool) = (geometry.pooled, geometry.pool);
    // Positions that do not fill a pool are dropped.
    let [steps, rows, columns] = [0, 1, 2].map(|axis| pooled[axis] * pool[axis]);
    let x = x.slice([0..count, 0..channels, 0..steps, 0..rows, 0..columns]);
    let planes = count * channels * pooled[0];
    let x = largest(&x.reshape([planes, pool[0], rows * columns]));
    let planes = planes * pooled[1];
    let x = largest(&x.reshape([planes, pool[1], columns]));
    let x = largest(&x.reshape([planes * pooled[2], pool[2], 1]));
    x.reshape([count, geometry.flat()])
}

/// Returns the maximum over the middle axis, whose elements are compared in ascending order.
fn largest(x: &Tensor<3>) -> Tensor<3> {
    let [outer, length, inner] = x.dims();
    let element = |at| x.clone().slice([0..outer, at..at + 1, 0..inner]);
    (1..length).fold(element(0), |largest, at| largest.max_pair(element(at)))
}

/// Unpools to the feature map by nearest neighbour. For example, in the paper's network, columns 0 to 2
/// of the five take pooled column 0, and columns 3 and 4 take pooled column 1.
pub(crate) fn unpool(flat: Tensor<2>, geometry: &Geometry) -> Tensor<5> {
    let (count, device) = (flat.dims()[0], flat.device());
    let [steps, rows, columns] = geometry.pooled;
    let mut x = flat.reshape([count, CONV2_CHANNELS, steps, rows, columns]);
    for axis in 0..3 {
        let (length, pooled) = (geometry.feature_map[axis], geometry.pooled[axis]);
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
