//! A ring buffer that keeps the most recent planes of a stream.

/// The `DEPTH` most recent planes, each of `LEN` elements.
#[derive(Clone, Copy, Debug)]
pub struct PlaneRing<T, const LEN: usize, const DEPTH: usize> {
    planes: [[T; LEN]; DEPTH],
    /// Index of the oldest plane, which is overwritten next.
    next: usize,
}

impl<T: Copy, const LEN: usize, const DEPTH: usize> PlaneRing<T, LEN, DEPTH> {
    /// Returns a ring in which all elements of all planes are `value`.
    pub const fn filled(value: T) -> Self {
        Self { planes: [[value; LEN]; DEPTH], next: 0 }
    }

    /// Drops the oldest plane and returns its memory, which the caller fills with the newest one.
    #[inline]
    pub fn advance(&mut self) -> &mut [T; LEN] {
        // `next` is below `DEPTH` anyway; the remainder lets the compiler drop the bounds check.
        let slot = self.next % DEPTH;
        self.next = (slot + 1) % DEPTH;
        &mut self.planes[slot]
    }

    /// Returns all planes, the oldest first.
    #[inline]
    pub fn oldest_first(&self) -> [&[T]; DEPTH] {
        core::array::from_fn(|age| &self.planes[(self.next + age) % DEPTH][..])
    }
}
