//! Flash and RAM of each part of the encoder on the device.

use artifact::{CONV1_CHANNELS, CONV2_CHANNELS, Dimensions, KERNEL};
use int8_nn::{InputConv, Pair, PlaneShape, Winograd};

use crate::{
    integer_model::IntegerModel,
    pack::{self, ConvKernel},
};

/// Size in bytes of a pair of weights, an accumulator or a requantisation factor: 32 bits each.
const WORD: usize = size_of::<Pair>();
/// Number of consecutive input planes from which a convolution computes one output plane.
const PLANES: usize = KERNEL;

/// Flash and RAM of one part of the encoder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Name of the part, with the kernel that computes it.
    pub name: String,
    /// Size of the part's packed weights, biases and factors, bytes.
    pub flash_bytes: usize,
    /// Size of the part's state and scratch memory, bytes.
    pub ram_bytes: usize,
}

/// Returns the parts of an encoder in signal order; none if the model has no network.
///
/// `hop` is the number of time steps from the start of one window to the start of the next.
pub fn parts(model: &IntegerModel, hop: usize) -> Vec<Part> {
    let Dimensions { steps, electrodes, numbers, .. } = model.geometry.dimensions;
    let open_windows = steps / hop;
    let mut parts = Vec::new();
    if !model.mode.has_network() {
        return parts;
    }
    if model.mode.has_convolutions() {
        parts.extend(convolutions(model));
    }
    if model.mode.has_shortcut() {
        let weights = pack::shortcut(model).iter().map(Vec::len).sum::<usize>();
        parts.push(Part {
            name: "shortcut".to_owned(),
            flash_bytes: WORD * weights + electrodes,
            ram_bytes: 0,
        });
    }
    parts.push(Part {
        name: format!("codes of {open_windows} open windows"),
        // Each value of a code has a bias, two factors (fully connected layer and shortcut), and a
        // zero point of one byte.
        flash_bytes: 3 * WORD * numbers + numbers,
        ram_bytes: open_windows * 2 * WORD * numbers,
    });
    parts
}

fn convolutions(model: &IntegerModel) -> [Part; 3] {
    let Dimensions { rows: grid_rows, columns: grid_columns, .. } = model.geometry.dimensions;
    let margin = model.geometry.padding.pads()[1];
    let [_, rows, columns] = model.geometry.pooled;
    let [_, pool_rows, pool_columns] = model.geometry.pool;
    let cells = (grid_rows + 2 * margin) * (grid_columns + 2 * margin);
    // Size of the region of the first convolution's output on which the pools depend, margins
    // included.
    let [framed_rows, framed_columns] =
        [rows * pool_rows, columns * pool_columns].map(|length| length + KERNEL - 1);
    let [_, hidden_rows, hidden_columns] = model.geometry.hidden;
    let interior = PlaneShape {
        rows: hidden_rows.min(framed_rows - margin),
        columns: hidden_columns.min(framed_columns - margin),
        channels: CONV1_CHANNELS,
    };
    // The buffer lengths do not depend on the number of input columns, which is set to 0 here.
    let conv1 = InputConv::<0> {
        rows: grid_rows,
        output: interior,
        weights: &[],
        bias: &[],
        multipliers: &[],
    };
    let framed = margin * framed_rows * framed_columns * CONV1_CHANNELS / 2;
    let hidden = interior.len() / 2 + framed;
    let scratch = conv1.patches_len() + conv1.sums_len() + hidden;
    let positions = rows * columns * CONV2_CHANNELS;
    let pool = WORD * positions + WORD / 2 * positions;
    let (name, transformed) = match ConvKernel::select(model) {
        ConvKernel::Winograd => (
            "conv2, pool: Winograd F(2x4, 3x3)",
            // A tile of 2x4 outputs holds two adjacent pools. The buffer's length depends only on
            // the number of tiles, so each tile is counted as a row of its own.
            Winograd::<{ CONV1_CHANNELS / 2 }, 6> {
                tile_rows: rows * columns / 2,
                outputs: CONV2_CHANNELS,
                weights: &[],
            }
            .transformed_len(),
        ),
        ConvKernel::Direct => {
            ("conv2, pool: direct", framed_rows * framed_columns * CONV1_CHANNELS / 2)
        }
    };
    let edges = if model.geometry.padding.pads_time() { 2 * WORD * transformed + pool } else { 0 };
    let matrices = pack::fully_connected(model);
    let fc = matrices.iter().flatten().map(Vec::len).sum::<usize>();
    [
        Part {
            name: "conv1".to_owned(),
            flash_bytes: WORD * (pack::input_convolution(&model.conv1).len() + 2 * CONV1_CHANNELS),
            ram_bytes: WORD * (PLANES * cells + scratch),
        },
        Part {
            name: name.to_owned(),
            flash_bytes: WORD * (pack::convolution(model).len() + 2 * CONV2_CHANNELS),
            ram_bytes: WORD * PLANES * transformed + pool + edges,
        },
        Part { name: "fully connected".to_owned(), flash_bytes: WORD * fc, ram_bytes: 0 },
    ]
}
