//! Calls each kernel of the encoder alone, with the built-in weights, to count its instructions.

use core::hint::black_box;

use int8_nn::Pair;
use model::{
    CELL_PLANE, CODE, ELECTRODE_PAIRS, FC_PIECES, HAS_CONVOLUTIONS, HAS_SHORTCUT, HIDDEN,
    HIDDEN_INTERIOR, HOP, NETWORK, Network, POOLED, POOLED_PAIRS, POOLED_STEPS, SHORTCUT_PAIRS,
    SHORTCUT_STEPS,
};

/// Number of consecutive planes that a convolution reads for one output plane.
const PLANES: usize = 3;
/// Number of [`Pair`]s of channels in the output of the first convolution for one step, without the
/// zero margin.
const INTERIOR: usize = HIDDEN_INTERIOR.len() / 2;
/// Number of pairs in a plane with its zero margin, which the second convolution also reads.
const FRAMED: usize = HIDDEN.len() / 2;
/// Number of pairs in a transformed input plane of the second convolution.
const TRANSFORMED: usize = NETWORK.conv2().transformed_len();

/// Weights of the linear shortcut for the first time step of a window. A network without a shortcut
/// does not use them.
const SHORTCUT_WEIGHTS: &[Pair; SHORTCUT_PAIRS] = match NETWORK.shortcut.first() {
    Some(weights) => weights,
    None => &[Pair::ZERO; SHORTCUT_PAIRS],
};

/// A kernel of the encoder, and how often the encoder calls it for each code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel {
    /// Name of the kernel's layer in reports.
    pub name: &'static str,
    /// Number of calls of the kernel for each code.
    pub per_code: u32,
}

/// Name of the linear shortcut's kernel.
pub const SHORTCUT: &str = "shortcut";

/// Calls `count` once for each kernel that the network has, with a closure that runs the kernel
/// once. The inputs are zeros; their values do not affect the number of instructions.
pub fn each(mut count: impl FnMut(Kernel, &mut dyn FnMut())) {
    #[expect(clippy::cast_possible_truncation, reason = "at most 32")]
    let mut count = |name, per_code: usize, run: &mut dyn FnMut()| {
        let per_code = per_code as u32;
        count(Kernel { name, per_code }, run);
    };
    if HAS_CONVOLUTIONS {
        each_of_convolutions(&mut count);
    }
    let mut code = [0; CODE];
    let electrodes = black_box([Pair::ZERO; ELECTRODE_PAIRS]);
    if HAS_SHORTCUT {
        count(SHORTCUT, SHORTCUT_STEPS, &mut || {
            Network::shortcut(SHORTCUT_WEIGHTS).accumulate(&electrodes, &mut code);
            black_box(&code);
        });
    }
}

/// Calls `count` once for each kernel of the convolutions and of the fully connected layer.
fn each_of_convolutions(count: &mut impl FnMut(&'static str, usize, &mut dyn FnMut())) {
    let cells = black_box([0_i8; CELL_PLANE.len()]);
    let mut input = black_box([[Pair::ZERO; CELL_PLANE.len()]; PLANES]);
    let mut patches = [Pair::ZERO; NETWORK.conv1().patches_len()];
    let mut sums = [0; NETWORK.conv1().sums_len()];
    let mut interior = [Pair::ZERO; INTERIOR];
    let hidden = black_box([Pair::ZERO; FRAMED]);
    let mut transformed = black_box([[Pair::ZERO; TRANSFORMED]; PLANES]);
    let mut largest = [i32::MIN; POOLED.len()];
    let mut code = [0; CODE];

    count("conv1", HOP, &mut || {
        let conv1 = NETWORK.conv1();
        conv1.pair_up(&cells, &mut input[0]);
        let planes = input.each_ref().map(|plane| &plane[..]);
        conv1.convolve(planes, &mut patches, &mut sums, &mut interior);
        black_box(&interior);
    });
    count("transform", HOP, &mut || {
        NETWORK.conv2().transform(&hidden, &mut transformed[0]);
        black_box(&transformed);
    });
    count("conv2, pool", HOP, &mut || {
        let planes = transformed.each_ref().map(|plane| &plane[..]);
        NETWORK.conv2().convolve_max_pool(planes, &mut largest);
        black_box(&largest);
    });
    let pooled = black_box([Pair::ZERO; POOLED_PAIRS]);
    count("fully connected", POOLED_STEPS, &mut || {
        let pieces = pooled.chunks_exact(POOLED_PAIRS / FC_PIECES);
        for (fc, pooled) in NETWORK.fc.iter().flatten().zip(pieces) {
            Network::fc(fc).accumulate(pooled, &mut code);
        }
        black_box(&code);
    });
}
