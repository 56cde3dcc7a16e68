//! Eight words as two [`Quad`]s, one for each round.

use crate::{
    dot::layout::{OUTPUTS, ROUND},
    octet::{INPUTS, Octet, WEIGHTS},
    pair::Pair,
    quad::Quad,
};

/// Two rounds, each `[output][pair]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Quads([Quad; 2]);

impl Octet for Quads {
    #[inline(always)]
    fn zeros() -> Self {
        Self([Quad::new([Pair::ZERO; OUTPUTS * ROUND]); 2])
    }

    #[inline(always)]
    fn inputs(&[a, b, c, d]: &[Pair; INPUTS]) -> Self {
        Self([Quad::new([a, b, a, b]), Quad::new([c, d, c, d])])
    }

    #[inline(always)]
    fn weights(&[a, b, c, d, e, f, g, h]: &[Pair; WEIGHTS]) -> Self {
        Self([Quad::new([a, b, c, d]), Quad::new([e, f, g, h])])
    }

    #[cfg(not(smlad))]
    #[inline(always)]
    fn low_bytes(self) -> Self {
        Self(self.0.map(Quad::low_bytes))
    }

    #[inline(always)]
    fn multiply_add(self, other: Self, sums: Self) -> Self {
        let ([a, b], [c, d], [first, second]) = (self.0, other.0, sums.0);
        Self([a.multiply_add(c, first), b.multiply_add(d, second)])
    }

    #[inline(always)]
    fn output_sums(self) -> [i32; OUTPUTS] {
        let [first, second] = self.0.map(|round| {
            let [a, b, c, d] = round.words();
            [a.wrapping_add(b), c.wrapping_add(d)]
        });
        core::array::from_fn(|output| first[output].wrapping_add(second[output]))
    }
}
