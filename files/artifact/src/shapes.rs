//! Names and shapes of the tensors of a model.

use crate::description::Mode;
use crate::geometry::{CONV1_CHANNELS, CONV2_CHANNELS, Dimensions, Geometry, KERNEL};

/// Number added to a variance before its square root is taken: PyTorch's default.
pub const NORM_EPSILON: f32 = 1e-5;

/// Name of the calibration tensor that holds the largest magnitude of the network's input, uV.
pub(crate) const INPUT_RANGE: &str = "input.max_abs";

/// Name and shape of a tensor; the dimensions are in PyTorch's order.
pub type NamedShape = (&'static str, Vec<usize>);

/// Returns names and shapes of the tensors of convolutions, norms and fully connected layers. The
/// max-pool yields `flat` values, and codes have `numbers` values.
fn convolution_shapes(flat: usize, numbers: usize) -> Vec<NamedShape> {
    let kernel = |first: usize, second: usize| vec![first, second, KERNEL, KERNEL, KERNEL];
    vec![
        ("encoder.conv1.weight", kernel(CONV1_CHANNELS, 1)),
        ("encoder.conv1.bias", vec![CONV1_CHANNELS]),
        ("encoder.norm1.weight", vec![CONV1_CHANNELS]),
        ("encoder.norm1.bias", vec![CONV1_CHANNELS]),
        ("encoder.norm1.running_mean", vec![CONV1_CHANNELS]),
        ("encoder.norm1.running_var", vec![CONV1_CHANNELS]),
        ("encoder.conv2.weight", kernel(CONV2_CHANNELS, CONV1_CHANNELS)),
        ("encoder.conv2.bias", vec![CONV2_CHANNELS]),
        ("encoder.norm2.weight", vec![CONV2_CHANNELS]),
        ("encoder.norm2.bias", vec![CONV2_CHANNELS]),
        ("encoder.norm2.running_mean", vec![CONV2_CHANNELS]),
        ("encoder.norm2.running_var", vec![CONV2_CHANNELS]),
        ("encoder.fc.weight", vec![numbers, flat]),
        ("encoder.fc.bias", vec![numbers]),
        ("decoder.fc.weight", vec![flat, numbers]),
        ("decoder.fc.bias", vec![flat]),
        ("decoder.conv1.weight", kernel(CONV2_CHANNELS, CONV1_CHANNELS)),
        ("decoder.conv1.bias", vec![CONV1_CHANNELS]),
        ("decoder.norm1.weight", vec![CONV1_CHANNELS]),
        ("decoder.norm1.bias", vec![CONV1_CHANNELS]),
        ("decoder.norm1.running_mean", vec![CONV1_CHANNELS]),
        ("decoder.norm1.running_var", vec![CONV1_CHANNELS]),
        ("decoder.conv2.weight", kernel(CONV1_CHANNELS, 1)),
        ("decoder.conv2.bias", vec![1]),
    ]
}

/// Returns name and shape of each tensor that `weights.safetensors` must have for a mode and the
/// sizes of its layers.
pub fn weight_shapes(mode: Mode, geometry: &Geometry) -> Vec<NamedShape> {
    let mut shapes = Vec::new();
    let numbers = geometry.dimensions.numbers;
    let window = geometry.dimensions.window_electrodes();
    if mode.has_convolutions() {
        shapes.extend(convolution_shapes(geometry.flat(), numbers));
    }
    if mode.has_shortcut() {
        shapes.push(("encoder.shortcut.weight", vec![numbers, window]));
        shapes.push(("decoder.shortcut.weight", vec![window, numbers]));
    }
    shapes
}

/// Returns name and shape of each tensor that `calibration.safetensors` must have for a mode and
/// the dimensions of a model.
pub fn calibration_shapes(mode: Mode, dimensions: &Dimensions) -> Vec<NamedShape> {
    let mut shapes = vec![(INPUT_RANGE, vec![1])];
    if mode.has_network() {
        shapes.push(("code.min", vec![dimensions.numbers]));
        shapes.push(("code.max", vec![dimensions.numbers]));
    }
    if mode.has_convolutions() {
        shapes.push(("activation1.max", vec![1]));
        shapes.push(("activation2.max", vec![1]));
    }
    shapes
}
