//! The choice of the implementation of octets, at run time on a PC.

#[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
mod avx2;
mod quads;

#[cfg(not(smlad))]
use crate::octet::Kernel;
pub(crate) use quads::Quads;

/// Runs a kernel with the fastest octets of this processor.
#[cfg(not(smlad))]
#[inline(always)]
pub(crate) fn run(kernel: impl Kernel) {
    #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
    let Some(kernel) = avx2::run_if_available(kernel) else {
        return;
    };
    kernel.run::<Quads>();
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;
    use crate::{
        dot::layout::{OUTPUTS, POSITIONS, ROUND},
        octet::{INPUTS, Octet, WEIGHTS},
        pair::Pair,
    };

    /// Sums of one step: those of three positions, and those of the weights' low bytes.
    type Sums = ([i32; POSITIONS * OUTPUTS], [i32; OUTPUTS]);

    /// Number of steps. Each multiplies other numbers.
    const STEPS: usize = 1_000;

    /// Records the sums of every step, on numbers at the ends of every range.
    struct Operations<'r>(&'r mut Vec<Sums>);

    impl Kernel for Operations<'_> {
        #[inline(always)]
        fn run<O: Octet>(self) {
            let (mut sums, mut low_sums) = ([O::zeros(); POSITIONS], O::zeros());
            for step in 0..STEPS {
                let weights = O::weights(&pairs(7 * step + 1));
                for (position, sums) in sums.iter_mut().enumerate() {
                    let inputs = O::inputs(&pairs(step + 31 * position));
                    *sums = inputs.multiply_add(weights, *sums);
                }
                let inputs = O::inputs(&pairs(step));
                low_sums = inputs.multiply_add(weights.low_bytes(), low_sums);
                self.0
                    .push((O::position_sums(sums), low_sums.output_sums()));
            }
        }
    }

    fn pairs<const N: usize>(step: usize) -> [Pair; N] {
        let numbers = [0, 1, -1, 127, -128, 255, 4080, 9144, i16::MAX, i16::MIN];
        let number = |at: usize| numbers[step * (at + 1) / 3 % numbers.len()];
        core::array::from_fn(|at| Pair::new([number(2 * at), number(2 * at + 1)]))
    }

    /// Returns the dot product of two rounds of inputs with the weights of one output.
    fn product(inputs: &[Pair; INPUTS], weights: &[Pair; WEIGHTS], output: usize) -> i32 {
        let products = inputs.iter().enumerate().map(|(at, input)| {
            let weight = weights[(at / ROUND * OUTPUTS + output) * ROUND + at % ROUND];
            let ([a, b], [c, d]) = (input.get().map(i32::from), weight.get().map(i32::from));
            (a * c).wrapping_add(b * d)
        });
        products.fold(0, i32::wrapping_add)
    }

    /// Returns the sums of every step, product by product.
    fn expected() -> Vec<Sums> {
        let (mut sums, mut low_sums) = ([0_i32; POSITIONS * OUTPUTS], [0_i32; OUTPUTS]);
        let low_byte = |number: i16| i16::from(number.to_le_bytes()[0].cast_signed());
        let steps = (0..STEPS).map(|step| {
            let weights = pairs(7 * step + 1);
            let low_bytes = weights.map(|pair: Pair| Pair::new(pair.get().map(low_byte)));
            for (at, sum) in sums.iter_mut().enumerate() {
                let inputs = pairs(step + 31 * (at / OUTPUTS));
                *sum = sum.wrapping_add(product(&inputs, &weights, at % OUTPUTS));
            }
            for (output, sum) in low_sums.iter_mut().enumerate() {
                *sum = sum.wrapping_add(product(&pairs(step), &low_bytes, output));
            }
            (sums, low_sums)
        });
        steps.collect()
    }

    #[test]
    fn two_quads_return_the_sums_of_single_products_at_the_ends_of_every_range() {
        let mut sums = Vec::new();
        Operations(&mut sums).run::<Quads>();
        assert_eq!(sums, expected());
    }

    #[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
    #[test]
    fn avx2_returns_the_sums_of_single_products_at_the_ends_of_every_range() {
        let mut sums = Vec::new();
        if avx2::run_if_available(Operations(&mut sums)).is_some() {
            std::eprintln!("SKIPPED: this processor has no AVX2");
            return;
        }
        assert_eq!(sums, expected());
    }
}
