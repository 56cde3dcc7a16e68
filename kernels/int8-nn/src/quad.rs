//! Four words that a PC processes together in one SIMD register.

#[cfg(any(test, not(target_feature = "sse2")))]
mod plain;
#[cfg(target_feature = "sse2")]
mod sse2;

#[cfg(not(target_feature = "sse2"))]
pub(crate) use plain::Quad;
#[cfg(target_feature = "sse2")]
pub(crate) use sse2::Quad;

#[cfg(target_feature = "sse2")]
#[cfg(test)]
mod tests {
    use super::{plain, sse2};
    use crate::pair::Pair;

    #[test]
    fn both_implementations_return_the_same_words_at_the_ends_of_every_range() {
        let numbers = [0, 1, -1, 127, -128, 255, 4080, 9144, i16::MAX, i16::MIN];
        let pairs = |step: usize| -> [Pair; 4] {
            core::array::from_fn(|at| {
                let number = |lane: usize| numbers[step * (2 * at + lane + 1) / 3 % numbers.len()];
                Pair::new([number(0), number(1)])
            })
        };
        let mut sums = (
            plain::Quad::new([Pair::ZERO; 4]),
            sse2::Quad::new([Pair::ZERO; 4]),
        );
        for step in 0..1_000 {
            let (x, weights) = (pairs(step), pairs(7 * step + 1));
            let plain = plain::Quad::new(weights);
            let sse2 = sse2::Quad::new(weights);
            assert_eq!(plain.low_bytes().words(), sse2.low_bytes().words());
            sums.0 = plain::Quad::new(x).multiply_add(plain, sums.0);
            sums.1 = sse2::Quad::new(x).multiply_add(sse2, sums.1);
            assert_eq!(sums.0.words(), sums.1.words());
        }
        assert_ne!(sums.0.words(), [0; 4]);
    }
}
