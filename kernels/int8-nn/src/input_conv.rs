//! The first convolution of a network, which has a single input channel.

#[cfg(not(smlad))]
use crate::octet::Kernel;
use crate::{
    dot::{self, OUTPUTS, POSITIONS, dots},
    octet::{self, Octet},
    pair::Pair,
    plane::PlaneShape,
    requantise::{requantise, saturate_u8},
};

/// Number of weights of each output channel: 3 steps x 3 rows x 3 columns.
const TAPS: usize = 27;
/// Number of pairs of weights of each output channel: 27 weights and one zero.
const WIDTH: usize = 14;
/// Number of groups of [`POSITIONS`] positions that one iteration of the assembler loop computes.
const GROUPS_PER_ITERATION: usize = 4;
/// Number of input pairs in a group of [`POSITIONS`] positions.
const GROUP: usize = POSITIONS * WIDTH;

/// A 3x3x3 convolution of one channel over (time, row, column), stride 1, unpadded, with ReLU. Each
/// call computes one plane.
///
/// The 27 inputs of each position are first copied side by side (im2col), so that the products can
/// use the same loop as the other layers. `COLUMNS` is the number of columns of the input, a
/// constant so that the offsets from row to row are constants as well.
#[derive(Clone, Copy, Debug)]
pub struct InputConv<'w, const COLUMNS: usize> {
    /// Number of rows of an input plane, at least 3.
    pub rows: usize,
    /// Shape of an output plane: at least two rows and two columns smaller than the input, and
    /// smaller still if later layers do not read the last rows or columns.
    pub output: PlaneShape,
    /// Weights, packed by [`Self::pack_weights`]: [`Self::weights_len`] pairs.
    pub weights: &'w [Pair],
    /// Bias of each output channel, in units of the accumulator.
    pub bias: &'w [i32],
    /// Requantisation factor of each output channel, Q0.32, in [-0.5, 0.5).
    pub multipliers: &'w [i32],
}

impl<const COLUMNS: usize> InputConv<'_, COLUMNS> {
    /// Returns the shape of an input plane: `rows` x `COLUMNS` positions, one channel.
    pub const fn input(&self) -> PlaneShape {
        PlaneShape { rows: self.rows, columns: COLUMNS, channels: 1 }
    }

    /// Returns the number of pairs in the packed weights of `outputs` output channels.
    pub const fn weights_len(outputs: usize) -> usize {
        outputs * WIDTH
    }

    /// Returns the required length of the scratch slice `patches` of [`Self::convolve`].
    pub const fn patches_len(&self) -> usize {
        self.groups() * GROUP
    }

    /// Returns the required length of the scratch slice `sums` of [`Self::convolve`].
    pub const fn sums_len(&self) -> usize {
        self.groups() * POSITIONS * OUTPUTS
    }

    /// Returns true if this convolution turns planes of shape `input` into planes of shape `output`
    /// and has the right numbers of weights, biases and factors. Callers should assert it in a
    /// `const` context.
    pub const fn is_consistent(&self, input: PlaneShape, output: PlaneShape) -> bool {
        self.input().equals(input)
            && self.output.equals(output)
            && !output.is_empty()
            && output.rows + 2 <= input.rows
            && output.columns + 2 <= input.columns
            && output.channels.is_multiple_of(OUTPUTS)
            && self.weights.len() == Self::weights_len(output.channels)
            && self.bias.len() == output.channels
            && self.multipliers.len() == output.channels
    }

    /// Returns the number of groups of [`POSITIONS`] positions, rounded up to whole iterations of
    /// the assembler loop; the sums of positions beyond the plane are not used.
    const fn groups(&self) -> usize {
        (self.output.rows * self.output.columns)
            .div_ceil(POSITIONS)
            .next_multiple_of(GROUPS_PER_ITERATION)
    }

    /// Convolves three input planes, oldest first, each prepared by [`Self::pair_up`], and writes
    /// the output plane: values 0..=255, `[pair of channels][row][column]`. `patches` and `sums`
    /// are scratch.
    ///
    /// # Panics
    /// If a slice is shorter than its shape requires, or [`Self::is_consistent`] is false.
    pub fn convolve(
        &self,
        planes: [&[Pair]; 3],
        patches: &mut [Pair],
        sums: &mut [i32],
        output: &mut [Pair],
    ) {
        assert!(
            self.is_consistent(self.input(), self.output),
            "the shapes and the numbers of weights are inconsistent"
        );
        let patches = &mut patches[..self.patches_len()];
        let sums = &mut sums[..self.sums_len()];
        let output = &mut output[..self.output.len() / OUTPUTS];
        #[cfg(smlad)]
        self.convolve_with::<octet::Plain>(planes, patches, sums, output);
        #[cfg(not(smlad))]
        octet::run((self, planes, [patches, output], sums));
    }

    /// Does what [`Self::convolve`] does, with octets of type `O`.
    #[inline(always)]
    fn convolve_with<O: Octet>(
        &self,
        planes: [&[Pair]; 3],
        patches: &mut [Pair],
        sums: &mut [i32],
        output: &mut [Pair],
    ) {
        self.gather_patches(planes, patches);
        let positions = self.output.rows * self.output.columns;
        let channels = self
            .bias
            .as_chunks::<OUTPUTS>()
            .0
            .iter()
            .zip(self.multipliers.as_chunks::<OUTPUTS>().0);
        let weights = self.weights.chunks_exact(OUTPUTS * WIDTH);
        for ((places, weights), (bias, multipliers)) in
            output.chunks_exact_mut(positions).zip(weights).zip(channels)
        {
            dots::<O, 1, WIDTH, WIDTH>([patches], weights, sums.as_chunks_mut().0);
            for (place, sums) in places.iter_mut().zip(sums.as_chunks::<OUTPUTS>().0) {
                let activation = |index: usize| {
                    let sum = sums[index].wrapping_add(bias[index]);
                    i16::from(saturate_u8(requantise(sum, multipliers[index])))
                };
                *place = Pair::new([activation(0), activation(1)]);
            }
        }
    }

    /// Pairs every input of a plane with the next input in memory, which is its right neighbour
    /// within a row; the last input is paired with 0.
    ///
    /// # Panics
    /// If a slice is shorter than the input plane.
    pub fn pair_up(&self, plane: &[i8], pairs: &mut [Pair]) {
        let plane = &plane[..self.input().len()];
        let pairs = &mut pairs[..plane.len()];
        for (pair, neighbours) in pairs.iter_mut().zip(plane.windows(2)) {
            *pair = Pair::new([neighbours[0].into(), neighbours[1].into()]);
        }
        if let (Some(pair), Some(&last)) = (pairs.last_mut(), plane.last()) {
            *pair = Pair::new([last.into(), 0]);
        }
    }

    /// Copies the 27 inputs of each position and a zero side by side (im2col), as 14 pairs. The
    /// first nine pairs hold columns 0 and 1 of each (time, row). The last five pairs hold column
    /// 2, two rows in a pair, and the zero.
    fn gather_patches(&self, planes: [&[Pair]; 3], patches: &mut [Pair]) {
        /// Returns the number of inputs from the first to the last of a 3x3 patch, in memory order.
        const fn reach(columns: usize) -> usize {
            2 * columns + 3
        }
        let columns = self.output.columns;
        let rows = patches.chunks_mut(columns * WIDTH).take(self.output.rows);
        for (row, patches) in rows.enumerate() {
            let [a, b, c] = planes.map(|plane| {
                let rows = &plane[row * COLUMNS..][..columns - 1 + reach(COLUMNS)];
                rows.windows(reach(COLUMNS))
            });
            let inputs = a.zip(b).zip(c);
            for (((a, b), c), patch) in inputs.zip(patches.as_chunks_mut::<WIDTH>().0) {
                #[cfg(smlad)]
                let [a, b, c] = [a, b, c].map(|window| {
                    [0, COLUMNS, 2 * COLUMNS].map(|row| [window[row], window[row + 2]])
                });
                // Written out, because LLVM does not inline `map` here on a PC.
                #[cfg(not(smlad))]
                let rows = |window: &[Pair]| {
                    [
                        [window[0], window[2]],
                        [window[COLUMNS], window[COLUMNS + 2]],
                        [window[2 * COLUMNS], window[2 * COLUMNS + 2]],
                    ]
                };
                #[cfg(not(smlad))]
                let (a, b, c) = (rows(a), rows(b), rows(c));
                *patch = [
                    a[0][0],
                    a[1][0],
                    a[2][0],
                    b[0][0],
                    b[1][0],
                    b[2][0],
                    c[0][0],
                    c[1][0],
                    c[2][0],
                    a[0][1].low_halves(a[1][1]),
                    a[2][1].low_halves(b[0][1]),
                    b[1][1].low_halves(b[2][1]),
                    c[0][1].low_halves(c[1][1]),
                    c[2][1].low_halves(Pair::ZERO),
                ];
            }
        }
    }

    /// Packs weights `[time][row][column][output]` of an even number of outputs into the order of
    /// the field `weights`.
    ///
    /// # Panics
    /// If `weights` does not have 27 * `outputs` numbers, or `packed` has fewer than
    /// [`Self::weights_len`] pairs.
    pub fn pack_weights(outputs: usize, weights: &[i8], packed: &mut [Pair]) {
        assert_eq!(weights.len(), TAPS * outputs, "27 weights for each output");
        packed.fill(Pair::ZERO);
        for (at, &weight) in weights.iter().enumerate() {
            let (tap, output) = (at / outputs, at % outputs);
            let step = output / OUTPUTS * dot::weights_len(WIDTH);
            let place = place(tap);
            let pair = &mut packed[step + dot::weight_index(output % OUTPUTS, place / 2)];
            *pair = pair.with(place % 2, weight.into());
        }
    }
}

/// Runs [`InputConv::convolve`] with the octets that the processor supports.
#[cfg(not(smlad))]
impl<const COLUMNS: usize> Kernel
    for (&InputConv<'_, COLUMNS>, [&[Pair]; 3], [&mut [Pair]; 2], &mut [i32])
{
    #[inline(always)]
    fn run<O: Octet>(self) {
        let (conv, planes, [patches, output], sums) = self;
        conv.convolve_with::<O>(planes, patches, sums, output);
    }
}

/// Returns the index of tap `(time * 3 + row) * 3 + column` among the 28 numbers that
/// `gather_patches` writes for a position.
const fn place(tap: usize) -> usize {
    let (row, column) = (tap / 3, tap % 3);
    if column < 2 { 2 * row + column } else { 2 * 9 + row }
}
