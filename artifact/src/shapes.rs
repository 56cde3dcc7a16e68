use crate::description::Mode;

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
/// Edge of every kernel, in all three dimensions; no padding.
pub(crate) const KERNEL: usize = 3;
/// Steps, rows, columns after the second convolution.
pub(crate) const FEATURE_MAP: [usize; 3] = [
    STEPS - 2 * (KERNEL - 1),
    ROWS - 2 * (KERNEL - 1),
    COLUMNS - 2 * (KERNEL - 1),
];
/// Steps, rows, columns after the 2x2x2 max-pool, which drops what does not fill a pool.
pub(crate) const POOLED: [usize; 3] = [FEATURE_MAP[0] / 2, FEATURE_MAP[1] / 2, FEATURE_MAP[2] / 2];
/// Input of the fully connected layer: channel, step, row, column, the last fastest.
pub(crate) const FLAT: usize = CHANNELS2 * POOLED[0] * POOLED[1] * POOLED[2];
/// Added to a variance before its root is taken; PyTorch's default.
pub const NORM_EPSILON: f32 = 1e-5;

const _: () = assert!(
    FLAT == 1152,
    "the flatten size that the weights on disk have"
);

/// Name and shape of a tensor.
pub type NamedShape = (&'static str, &'static [usize]);

/// Convolutions, norms and fully connected layers of encoder and decoder.
const NETWORK: &[NamedShape] = &[
    (
        "encoder.conv1.weight",
        &[CHANNELS1, 1, KERNEL, KERNEL, KERNEL],
    ),
    ("encoder.conv1.bias", &[CHANNELS1]),
    ("encoder.norm1.weight", &[CHANNELS1]),
    ("encoder.norm1.bias", &[CHANNELS1]),
    ("encoder.norm1.running_mean", &[CHANNELS1]),
    ("encoder.norm1.running_var", &[CHANNELS1]),
    (
        "encoder.conv2.weight",
        &[CHANNELS2, CHANNELS1, KERNEL, KERNEL, KERNEL],
    ),
    ("encoder.conv2.bias", &[CHANNELS2]),
    ("encoder.norm2.weight", &[CHANNELS2]),
    ("encoder.norm2.bias", &[CHANNELS2]),
    ("encoder.norm2.running_mean", &[CHANNELS2]),
    ("encoder.norm2.running_var", &[CHANNELS2]),
    ("encoder.fc.weight", &[CODE, FLAT]),
    ("encoder.fc.bias", &[CODE]),
    ("decoder.fc.weight", &[FLAT, CODE]),
    ("decoder.fc.bias", &[FLAT]),
    (
        "decoder.conv1.weight",
        &[CHANNELS2, CHANNELS1, KERNEL, KERNEL, KERNEL],
    ),
    ("decoder.conv1.bias", &[CHANNELS1]),
    ("decoder.norm1.weight", &[CHANNELS1]),
    ("decoder.norm1.bias", &[CHANNELS1]),
    ("decoder.norm1.running_mean", &[CHANNELS1]),
    ("decoder.norm1.running_var", &[CHANNELS1]),
    (
        "decoder.conv2.weight",
        &[CHANNELS1, 1, KERNEL, KERNEL, KERNEL],
    ),
    ("decoder.conv2.bias", &[1]),
];

/// The linear maps from a window to its code and back.
const SHORTCUT: &[NamedShape] = &[
    ("encoder.shortcut.weight", &[CODE, WINDOW_ELECTRODES]),
    ("decoder.shortcut.weight", &[WINDOW_ELECTRODES, CODE]),
];

const LINEAR_RANGES: &[NamedShape] = &[
    ("input.max_abs", &[1]),
    ("code.min", &[CODE]),
    ("code.max", &[CODE]),
];

const ACTIVATION_RANGES: &[NamedShape] = &[("activation1.max", &[1]), ("activation2.max", &[1])];

/// The tensors of `weights.safetensors` for a mode: exactly these.
pub fn weight_shapes(mode: Mode) -> Vec<NamedShape> {
    let network = if mode.has_convolutions() {
        NETWORK
    } else {
        &[]
    };
    let shortcut = if mode.has_shortcut() { SHORTCUT } else { &[] };
    [network, shortcut].concat()
}

/// The tensors of `calibration.safetensors` for a mode: exactly these.
pub(crate) fn calibration(mode: Mode) -> Vec<NamedShape> {
    let activations = if mode.has_convolutions() {
        ACTIVATION_RANGES
    } else {
        &[]
    };
    [LINEAR_RANGES, activations].concat()
}
