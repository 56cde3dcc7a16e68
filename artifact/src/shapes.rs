use crate::description::Mode;
use crate::geometry::Geometry;

/// Time steps of a window, at 128 Hz.
pub const STEPS: usize = 16;
/// Rows of the scalp grid, front to back.
pub const ROWS: usize = 10;
/// Columns of the scalp grid, left to right.
pub const COLUMNS: usize = 9;
/// Cells of one plane of the scalp grid; empty cells hold 0.
pub const CELLS: usize = ROWS * COLUMNS;
/// Electrodes: the cells that are not empty.
pub const ELECTRODES: usize = 61;
/// Numbers in a code.
pub const CODE: usize = 128;
/// Numbers of a window on the scalp grid; step, row, column, the last fastest.
pub const WINDOW_CELLS: usize = STEPS * CELLS;
/// Numbers of a window of electrodes alone; electrode fastest.
pub const WINDOW_ELECTRODES: usize = STEPS * ELECTRODES;

/// Channels after the first convolution.
pub(crate) const CHANNELS1: usize = 16;
/// Channels after the second convolution.
pub(crate) const CHANNELS2: usize = 32;
/// Edge of every kernel, in all three dimensions.
pub(crate) const KERNEL: usize = 3;
/// Added to a variance before its root is taken; PyTorch's default.
pub const NORM_EPSILON: f32 = 1e-5;

/// Name and shape of a tensor.
pub type NamedShape = (&'static str, Vec<usize>);

/// Convolutions, norms and fully connected layers of encoder and decoder.
fn network(flat: usize) -> Vec<NamedShape> {
    let kernel = |first: usize, second: usize| vec![first, second, KERNEL, KERNEL, KERNEL];
    vec![
        ("encoder.conv1.weight", kernel(CHANNELS1, 1)),
        ("encoder.conv1.bias", vec![CHANNELS1]),
        ("encoder.norm1.weight", vec![CHANNELS1]),
        ("encoder.norm1.bias", vec![CHANNELS1]),
        ("encoder.norm1.running_mean", vec![CHANNELS1]),
        ("encoder.norm1.running_var", vec![CHANNELS1]),
        ("encoder.conv2.weight", kernel(CHANNELS2, CHANNELS1)),
        ("encoder.conv2.bias", vec![CHANNELS2]),
        ("encoder.norm2.weight", vec![CHANNELS2]),
        ("encoder.norm2.bias", vec![CHANNELS2]),
        ("encoder.norm2.running_mean", vec![CHANNELS2]),
        ("encoder.norm2.running_var", vec![CHANNELS2]),
        ("encoder.fc.weight", vec![CODE, flat]),
        ("encoder.fc.bias", vec![CODE]),
        ("decoder.fc.weight", vec![flat, CODE]),
        ("decoder.fc.bias", vec![flat]),
        ("decoder.conv1.weight", kernel(CHANNELS2, CHANNELS1)),
        ("decoder.conv1.bias", vec![CHANNELS1]),
        ("decoder.norm1.weight", vec![CHANNELS1]),
        ("decoder.norm1.bias", vec![CHANNELS1]),
        ("decoder.norm1.running_mean", vec![CHANNELS1]),
        ("decoder.norm1.running_var", vec![CHANNELS1]),
        ("decoder.conv2.weight", kernel(CHANNELS1, 1)),
        ("decoder.conv2.bias", vec![1]),
    ]
}

/// The tensors of `weights.safetensors` for a mode and the sizes of its convolutions: exactly these.
pub fn weight_shapes(mode: Mode, geometry: &Geometry) -> Vec<NamedShape> {
    let mut shapes = Vec::new();
    if mode.has_convolutions() {
        shapes.extend(network(geometry.flat()));
    }
    if mode.has_shortcut() {
        shapes.push(("encoder.shortcut.weight", vec![CODE, WINDOW_ELECTRODES]));
        shapes.push(("decoder.shortcut.weight", vec![WINDOW_ELECTRODES, CODE]));
    }
    shapes
}

/// The tensors of `calibration.safetensors` for a mode: exactly these.
pub(crate) fn calibration(mode: Mode) -> Vec<NamedShape> {
    let mut shapes = vec![
        ("input.max_abs", vec![1]),
        ("code.min", vec![CODE]),
        ("code.max", vec![CODE]),
    ];
    if mode.has_convolutions() {
        shapes.push(("activation1.max", vec![1]));
        shapes.push(("activation2.max", vec![1]));
    }
    shapes
}
