//! Computes hidden planes: the output of the first convolution, transformed for the second.

use int8_nn::Pair;
use model::{HIDDEN, HIDDEN_INTERIOR, HIDDEN_PAIRS, MARGIN, NETWORK, Network};

/// Length, in pairs, of the scratch memory for the first convolution's gathered inputs.
const PATCHES: usize = NETWORK.conv1().patches_len();
/// Length, in words, of the scratch memory for the first convolution's sums.
const SUMS: usize = NETWORK.conv1().sums_len();
/// Number of pairs in a hidden plane without its margin.
const INTERIOR: usize = HIDDEN_INTERIOR.len() / 2;
/// Number of pairs in a hidden plane with its margin; 0 if the convolutions are not padded.
const FRAMED: usize = if MARGIN == 0 { 0 } else { HIDDEN.len() / 2 };

/// Scratch memory for computing a hidden plane, which is between the two convolutions.
#[derive(Clone, Debug)]
pub(super) struct HiddenPlane {
    patches: [Pair; PATCHES],
    sums: [i32; SUMS],
    interior: [Pair; INTERIOR],
    framed: [Pair; FRAMED],
}

impl HiddenPlane {
    /// Scratch memory before the first plane.
    pub(super) const EMPTY: Self = Self {
        patches: [Pair::ZERO; PATCHES],
        sums: [0; SUMS],
        interior: [Pair::ZERO; INTERIOR],
        framed: [Pair::ZERO; FRAMED],
    };

    /// Convolves three input planes, oldest first, and transforms the result for the second convolution.
    #[inline]
    pub(super) fn compute(
        &mut self,
        network: &Network<'_>,
        input: [&[Pair]; 3],
        transformed: &mut [Pair],
    ) {
        network
            .conv1()
            .convolve(input, &mut self.patches, &mut self.sums, &mut self.interior);
        let plane = if MARGIN == 0 {
            &self.interior[..]
        } else {
            self.frame(network);
            &self.framed[..]
        };
        network.conv2().transform(plane, transformed);
    }

    /// Transforms a plane of padding for the second convolution.
    pub(super) fn compute_padding(&mut self, network: &Network<'_>, transformed: &mut [Pair]) {
        let planes = self.framed.chunks_exact_mut(HIDDEN.rows * HIDDEN.columns);
        for (plane, &padding) in planes.zip(&network.hidden_padding) {
            plane.fill(padding);
        }
        network.conv2().transform(&self.framed, transformed);
    }

    /// Copies the interior into the plane with its margin, adds the offset of each channel to the
    /// interior, and fills the margin with padding.
    fn frame(&mut self, network: &Network<'_>) {
        let channels = network.hidden_padding.iter().zip(&network.hidden_offset);
        let planes = self.framed.chunks_exact_mut(HIDDEN.rows * HIDDEN.columns);
        let interiors = self.interior.chunks_exact(INTERIOR / HIDDEN_PAIRS);
        for ((framed, interior), (&padding, &offset)) in planes.zip(interiors).zip(channels) {
            framed.fill(padding);
            let rows = framed.chunks_exact_mut(HIDDEN.columns).skip(MARGIN);
            for (row, numbers) in rows.zip(interior.chunks_exact(HIDDEN_INTERIOR.columns)) {
                for (place, &number) in row[MARGIN..].iter_mut().zip(numbers) {
                    *place = number + offset;
                }
            }
        }
    }
}
