//! A ring buffer of the most recent planes of a stream.

/// A ring of the `DEPTH` most recent planes of `LEN` elements.
#[derive(Clone, Copy, Debug)]
pub struct PlaneRing<T, const LEN: usize, const DEPTH: usize> {
    planes: [[T; LEN]; DEPTH],
    /// Index of the next plane to overwrite, the oldest.
    next: usize,
}

impl<T: Copy, const LEN: usize, const DEPTH: usize> PlaneRing<T, LEN, DEPTH> {
    /// Returns a ring whose elements are all `value`.
    pub const fn filled(value: T) -> Self {
        Self {
            planes: [[value; LEN]; DEPTH],
            next: 0,
        }
    }

    /// Makes the oldest plane the newest and returns it, to be overwritten.
    #[inline]
    pub fn advance(&mut self) -> &mut [T; LEN] {
        // `next` is below `DEPTH`; the remainder lets the compiler drop the bounds check.
        let slot = self.next % DEPTH;
        self.next = (slot + 1) % DEPTH;
        &mut self.planes[slot]
    }

    /// Returns all planes; index 0 is the oldest.
    #[inline]
    pub fn oldest_first(&self) -> [&[T]; DEPTH] {
        core::array::from_fn(|age| &self.planes[(self.next + age) % DEPTH][..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_returned_oldest_first() {
        let mut ring = PlaneRing::<u8, 1, 3>::filled(0);
        for value in 1..=5 {
            *ring.advance() = [value];
        }
        assert_eq!(ring.oldest_first(), [[3], [4], [5]]);
    }
}
