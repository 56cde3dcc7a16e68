//! Runs the int8 kernels on random layers of random shapes, in which extreme weights and
//! activations are frequent. `build.rs` includes this file as well.

use int8_nn::{Direct, InputConv, Linear, Pair, PlaneShape, Winograd};

use crate::signal::Noise;

/// Number of random networks, each of which has one layer of each kind.
pub(crate) const NETWORKS: usize = 16;

/// Largest number of rows of Winograd tiles in a random convolution.
const TILE_ROWS: usize = 3;
/// Largest number of output channels of a random convolution: with 6, the memory of the Winograd
/// convolution would not fit a board's 32 KB stack.
const OUTPUTS: usize = 4;
/// Largest number of input rows of a random first convolution.
const ROWS: usize = 10;
/// Largest number of outputs of a random fully connected layer.
const SUMS: usize = 8;
/// Largest number of input pairs of a random fully connected layer.
const PAIRS: usize = 128;

/// Number of input columns of the random first convolutions.
const COLUMNS: usize = 11;
/// Number of input columns of the random second convolutions.
const HIDDEN_COLUMNS: usize = 10;
/// Number of pairs of input channels of the second convolution in each random network.
const HIDDEN_PAIRS: usize = 8;

type First<'w> = InputConv<'w, COLUMNS>;
type Conv<'w> = Winograd<'w, HIDDEN_PAIRS, HIDDEN_COLUMNS>;
type Plain<'w> = Direct<'w, HIDDEN_PAIRS, HIDDEN_COLUMNS>;

/// Returns a hash for each random network, over the outputs of all its kernels.
pub(crate) fn digests() -> [u32; NETWORKS] {
    let mut seed = 0;
    [(); NETWORKS].map(|()| {
        seed += 1;
        let mut draw = Draw(Noise(seed));
        let mut hash = Hash(0x811c_9dc5);
        draw.input_conv(&mut hash);
        draw.winograd(&mut hash);
        draw.direct(&mut hash);
        draw.linear(&mut hash);
        hash.0
    })
}

/// 32-bit FNV-1a hash (Fowler, Noll and Vo) over 32-bit words instead of bytes.
struct Hash(u32);

impl Hash {
    fn add(&mut self, words: impl Iterator<Item = u32>) {
        for word in words {
            self.0 = (self.0 ^ word).wrapping_mul(0x0100_0193);
        }
    }
}

struct Draw(Noise);

impl Draw {
    /// Draws a number from 1 to `most`, both included.
    fn up_to(&mut self, most: usize) -> usize {
        1 + (self.0.next() >> 16) as usize % most
    }

    /// Draws a weight from -127 to 127: 127 and -127 with a probability of 1/8 each, otherwise
    /// uniformly distributed.
    fn weight(&mut self) -> i8 {
        let [.., choice, any] = self.0.next().to_le_bytes();
        match choice % 8 {
            0 => 127,
            1 => -127,
            _ => any.cast_signed().max(-127),
        }
    }

    fn activation(&mut self) -> i16 {
        let [.., choice, any] = self.0.next().to_le_bytes();
        i16::from(if choice.is_multiple_of(4) { 255 } else { any })
    }

    fn activations(&mut self, pairs: &mut [Pair]) {
        for pair in pairs {
            *pair = Pair::new([self.activation(), self.activation()]);
        }
    }

    #[inline(never)]
    fn input_conv(&mut self, hash: &mut Hash) {
        let (rows, pairs) = (2 + self.up_to(ROWS - 2), self.up_to(OUTPUTS / 2));
        let outputs = 2 * pairs;
        let output =
            PlaneShape { rows: rows - 2, columns: 1 + self.up_to(COLUMNS - 3), channels: outputs };
        let weights: [i8; 27 * OUTPUTS] = core::array::from_fn(|_| self.weight());
        let mut packed = [Pair::ZERO; First::weights_len(OUTPUTS)];
        let packed = &mut packed[..First::weights_len(outputs)];
        First::pack_weights(outputs, &weights[..27 * outputs], packed);
        let conv = First {
            rows,
            output,
            weights: packed,
            bias: &[1_000; OUTPUTS][..outputs],
            multipliers: &[12_000_000; OUTPUTS][..outputs],
        };
        let mut planes = [[Pair::ZERO; ROWS * COLUMNS]; 3];
        for plane in &mut planes {
            let cells: [i8; ROWS * COLUMNS] = core::array::from_fn(|_| self.weight());
            conv.pair_up(&cells, plane);
        }
        let mut patches = [Pair::ZERO; 14 * (ROWS * COLUMNS)];
        let mut sums = [0; 2 * ROWS * COLUMNS];
        let mut found = [Pair::ZERO; ROWS * COLUMNS * OUTPUTS / 2];
        let planes = planes.each_ref().map(|plane| &plane[..]);
        conv.convolve(planes, &mut patches, &mut sums, &mut found);
        hash.add(found.iter().map(|Pair(bits)| *bits));
    }

    #[inline(never)]
    fn winograd(&mut self, hash: &mut Hash) {
        const INPUT: usize = (2 * TILE_ROWS + 2) * HIDDEN_COLUMNS * HIDDEN_PAIRS;
        const TRANSFORMED: usize = 2 * 3 * 24 * HIDDEN_PAIRS;
        let (tile_rows, outputs) = (self.up_to(TILE_ROWS), 2 * self.up_to(OUTPUTS / 2));
        let weights: [i8; 27 * 2 * HIDDEN_PAIRS * OUTPUTS] =
            core::array::from_fn(|_| self.weight());
        let mut transformed = [Pair::ZERO; Conv::weights_len(OUTPUTS)];
        let transformed = &mut transformed[..Conv::weights_len(outputs)];
        let weights = &weights[..27 * 2 * HIDDEN_PAIRS * outputs];
        Conv::transform_weights(outputs, weights, transformed);
        let conv = Conv { tile_rows, outputs, weights: transformed };
        let mut planes = [[Pair::ZERO; TRANSFORMED]; 3];
        for plane in &mut planes {
            let mut activations = [Pair::ZERO; INPUT];
            self.activations(&mut activations);
            conv.transform(&activations, plane);
        }
        let mut largest = [i32::MIN; TILE_ROWS * 4 * OUTPUTS];
        conv.convolve_max_pool(planes.each_ref().map(|plane| &plane[..]), &mut largest);
        hash.add(largest.iter().map(|sum| sum.cast_unsigned()));
    }

    /// Runs the direct convolution with inputs of both signs and a random pool: 1 x 8, 2 x 4 or 4 x
    /// 2 (rows x columns).
    #[inline(never)]
    fn direct(&mut self, hash: &mut Hash) {
        const ROWS: usize = 4;
        const INPUT: usize = (ROWS + 2) * HIDDEN_COLUMNS * HIDDEN_PAIRS;
        let outputs = 2 * self.up_to(OUTPUTS / 2);
        let pool = [1, 2, 4].map(|rows| [rows, 8 / rows])[self.up_to(3) - 1];
        let pooled = PlaneShape {
            rows: ROWS / pool[0],
            columns: (HIDDEN_COLUMNS - 2) / pool[1],
            channels: outputs,
        };
        let weights: [i8; 27 * 2 * HIDDEN_PAIRS * OUTPUTS] =
            core::array::from_fn(|_| self.weight());
        let weights = &weights[..27 * 2 * HIDDEN_PAIRS * outputs];
        let mut packed = [Pair::ZERO; Plain::weights_len(OUTPUTS)];
        let packed = &mut packed[..Plain::weights_len(outputs)];
        Plain::pack_weights(outputs, weights, packed);
        let conv = Plain { pool, pooled, weights: packed };
        let mut planes = [[Pair::ZERO; INPUT]; 3];
        for plane in &mut planes {
            let mut activations = [Pair::ZERO; INPUT];
            self.activations(&mut activations);
            let offset = self.0.next();
            for pair in &mut activations {
                *pair = *pair - Pair(offset & 0x03ff_03ff);
            }
            conv.transform(&activations, plane);
        }
        let mut largest = [i32::MIN; ROWS * HIDDEN_COLUMNS * OUTPUTS];
        conv.convolve_max_pool(planes.each_ref().map(|plane| &plane[..]), &mut largest);
        hash.add(largest.iter().map(|sum| sum.cast_unsigned()));
    }

    #[inline(never)]
    fn linear(&mut self, hash: &mut Hash) {
        let (inputs, outputs) = (8 * self.up_to(PAIRS / 8), 4 * self.up_to(SUMS / 4));
        let weights: [i8; 2 * PAIRS * SUMS] = core::array::from_fn(|_| self.weight());
        let mut packed = [Pair::ZERO; PAIRS * SUMS / 2];
        let packed = &mut packed[..inputs * outputs / 2];
        Linear::pack_weights(inputs, outputs, &weights[..2 * inputs * outputs], packed);
        let layer = Linear { inputs, outputs, weights: packed };
        let mut activations = [Pair::ZERO; PAIRS];
        self.activations(&mut activations);
        let mut sums = [0; SUMS];
        layer.accumulate(&activations, &mut sums);
        hash.add(sums.iter().map(|sum| sum.cast_unsigned()));
    }
}
