//! Fully connected layers, computed slice by slice as their inputs arrive.

#[cfg(smlad)]
mod cortex_m;

#[cfg(not(smlad))]
use crate::octet::{self, Kernel, Octet};
use crate::pair::Pair;

/// Number of outputs computed together, as two pairs.
const OUTPUTS: usize = 4;
/// Number of input pairs that one round of the unrolled loop multiplies.
const ROUND: usize = 2;
/// Number of input pairs in one iteration of the assembler loop, whose rounds are unrolled.
const INPUTS: usize = 8;

/// Returns the index of the packed pair that holds the weights of input pair `pair` for output
/// `output`, in a matrix with `inputs` pairs of inputs.
const fn weight_index(inputs: usize, pair: usize, output: usize) -> usize {
    let round = output / OUTPUTS * (inputs / ROUND) + pair / ROUND;
    (round * 2 + output % OUTPUTS / 2) * ROUND + pair % ROUND
}

/// Largest number of outputs. With more, byte offsets of the weights could exceed 32 bits.
const MAX_OUTPUTS: usize = 65_536;

/// The weights from a slice of a layer's inputs to all outputs of the layer.
///
/// A fully connected layer over a window is one `Linear` for each plane: the accumulators start at
/// the bias, and the product of each plane is added when the plane arrives.
///
/// Two 8-bit weights share a 16-bit number `256 * odd + even`, where `odd` is the weight of an odd
/// output and `even` the weight of the even output before it. The products of the inputs with the
/// 16-bit numbers sum to `256 * odd sum + even sum`, the products with the low bytes to the even
/// sum; a subtraction yields the odd sum. The odd weights need no unpacking, and each weight takes
/// 8 bits.
#[derive(Clone, Copy, Debug)]
pub struct Linear<'w> {
    /// Number of pairs of inputs: a multiple of 8, at most [`Self::MAX_INPUTS`]. Callers with fewer
    /// inputs add zeros.
    pub inputs: usize,
    /// Number of outputs: a multiple of 4.
    pub outputs: usize,
    /// Weights, packed by [`Self::pack_weights`]: [`Self::weights_len`] pairs.
    pub weights: &'w [Pair],
}

impl Linear<'_> {
    /// Largest number of pairs of inputs: 256 inputs. 256 products of at most 255 * 127 sum to less
    /// than 2^23, so 256 times the sum of an odd output still fits 32 bits. Callers with inputs
    /// above 255 must prove that it fits.
    pub const MAX_INPUTS: usize = 128;

    /// Returns the number of pairs in the packed weights.
    pub const fn weights_len(&self) -> usize {
        self.inputs * self.outputs / 2
    }

    /// Returns true if this matrix has `inputs` pairs of inputs, `outputs` outputs and the right
    /// number of weights. Callers should assert it in a `const` context.
    pub const fn is_consistent(&self, inputs: usize, outputs: usize) -> bool {
        self.inputs == inputs
            && self.outputs == outputs
            && inputs > 0
            && inputs.is_multiple_of(INPUTS)
            && inputs <= Self::MAX_INPUTS
            && outputs > 0
            && outputs.is_multiple_of(OUTPUTS)
            && outputs <= MAX_OUTPUTS
            && self.weights.len() == self.weights_len()
    }

    /// Adds `weights * inputs` to the accumulators, wrapping. The products of each output must sum
    /// to a magnitude below 2^23, as they do if all inputs are at most 255 in magnitude.
    ///
    /// # Panics
    /// If a slice is shorter than the matrix requires, or [`Self::is_consistent`] is false.
    pub fn accumulate(&self, inputs: &[Pair], accumulators: &mut [i32]) {
        assert!(
            self.try_accumulate(inputs, accumulators),
            "a matrix must have whole rounds of inputs and outputs, and the right number of weights; slices \
             must not be shorter"
        );
    }

    /// Does what [`Self::accumulate`] does and returns true; where `accumulate` would panic,
    /// changes nothing and returns false. For callers whose matrix is not known at compile time.
    #[inline]
    pub fn try_accumulate(&self, inputs: &[Pair], accumulators: &mut [i32]) -> bool {
        let (Some(inputs), Some(accumulators)) =
            (inputs.get(..self.inputs), accumulators.get_mut(..self.outputs))
        else {
            return false;
        };
        if !self.is_consistent(self.inputs, self.outputs) {
            return false;
        }
        #[cfg(smlad)]
        cortex_m::accumulate(inputs, self.weights, accumulators);
        #[cfg(not(smlad))]
        octet::run((inputs, self.weights, accumulators));
        true
    }

    /// Packs weights `[input][output]` for `inputs` pairs of inputs into the order of the field
    /// `weights`; missing weights are 0.
    ///
    /// # Panics
    /// If there are more weights than the matrix holds, or a weight is -128, with which
    /// `256 * odd + even` would not fit 16 bits.
    pub fn pack_weights(inputs: usize, outputs: usize, weights: &[i8], packed: &mut [Pair]) {
        assert!(
            weights.len() <= 2 * inputs * outputs,
            "at most one weight for each input and output"
        );
        packed.fill(Pair::ZERO);
        for (at, &weight) in weights.iter().enumerate() {
            assert!(weight != i8::MIN, "weights are -127..=127");
            let (input, output) = (at / outputs, at % outputs);
            let (pair, lane) = (input / 2, input % 2);
            let both = &mut packed[weight_index(inputs, pair, output)];
            let shared = both.get()[lane] + (i16::from(weight) << (8 * (output % 2)));
            *both = both.with(lane, shared);
        }
    }

    /// Returns the weights from both inputs of a pair to an output, as given to
    /// [`Self::pack_weights`]; 0 outside the matrix.
    #[inline]
    pub fn weights_from(&self, pair: usize, output: usize) -> Pair {
        if pair >= self.inputs || output >= self.outputs {
            return Pair::ZERO;
        }
        let shared = self.weights.get(weight_index(self.inputs, pair, output));
        // The low byte is the even weight; after its subtraction, the high byte is the odd weight.
        let weight = |shared: i16| {
            let even = i16::from(shared.to_le_bytes()[0].cast_signed());
            if output.is_multiple_of(2) { even } else { shared.wrapping_sub(even) >> 8 }
        };
        Pair::new(shared.map_or([0; 2], |shared| shared.get().map(weight)))
    }

    /// Copies the weights of this matrix's input `from` over the weights of input `to` in `packed`,
    /// the packed weights of a matrix with `inputs` pairs of inputs and the same number of outputs.
    /// If either input is outside its matrix, nothing is copied.
    pub fn copy_input(&self, from: usize, packed: &mut [Pair], inputs: usize, to: usize) {
        if from / 2 >= self.inputs || to / 2 >= inputs {
            return;
        }
        for output in [0, 2] {
            let mut source = weight_index(self.inputs, from / 2, output);
            let mut target = weight_index(inputs, to / 2, output);
            while let (Some(weights), Some(place)) =
                (self.weights.get(source), packed.get_mut(target))
            {
                *place = place.with(to % 2, weights.get()[from % 2]);
                // The weights of four outputs for all inputs are stored together; the weights of
                // the next four outputs follow.
                source += self.inputs * OUTPUTS / 2;
                target += inputs * OUTPUTS / 2;
            }
        }
    }
}

/// Inputs, weights and accumulators for [`Linear::accumulate`] with octets.
#[cfg(not(smlad))]
type Accumulate<'a> = (&'a [Pair], &'a [Pair], &'a mut [i32]);

#[cfg(not(smlad))]
impl Kernel for Accumulate<'_> {
    /// The portable equivalent of the assembler. Each of the two outputs of an octet stands for a
    /// pair of outputs here.
    #[inline(always)]
    fn run<O: Octet>(self) {
        let (inputs, weights, accumulators) = self;
        let quads = weights.chunks_exact(inputs.len() * OUTPUTS / 2);
        let inputs = inputs.as_chunks::<{ octet::INPUTS }>().0;
        for (weights, outputs) in quads.zip(accumulators.as_chunks_mut::<OUTPUTS>().0) {
            let (mut both, mut even) = (O::zeros(), O::zeros());
            let weights = weights.as_chunks::<{ octet::WEIGHTS }>().0;
            for (inputs, weights) in inputs.iter().zip(weights) {
                let (inputs, weights) = (O::inputs(inputs), O::weights(weights));
                both = inputs.multiply_add(weights, both);
                even = inputs.multiply_add(weights.low_bytes(), even);
            }
            let (both, even) = (both.output_sums(), even.output_sums());
            for (index, outputs) in outputs.as_chunks_mut::<2>().0.iter_mut().enumerate() {
                let odd = both[index].wrapping_sub(even[index]) >> 8;
                *outputs = [outputs[0].wrapping_add(even[index]), outputs[1].wrapping_add(odd)];
            }
        }
    }
}
