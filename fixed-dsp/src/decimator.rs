//! Rate reduction by an integer factor.

/// Keeps every `factor`-th sample, the first one included, without a filter of its own: whatever
/// the signal still holds above half of the new rate folds back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decimator {
    factor: u8,
    /// Samples until the next one is kept, 0..factor.
    until_next: u8,
}

impl Decimator {
    /// A decimator that keeps the next sample and then every `factor`-th.
    ///
    /// # Panics
    /// When `factor` is 0; at compile time in a `const` context.
    pub const fn new(factor: u8) -> Self {
        assert!(factor > 0, "a decimation factor is at least 1");
        Self {
            factor,
            until_next: 0,
        }
    }

    /// Counts one sample in; true when it is one to keep.
    #[inline]
    pub fn keeps_next(&mut self) -> bool {
        let keep = self.until_next == 0;
        self.until_next = if keep {
            self.factor - 1
        } else {
            self.until_next - 1
        };
        keep
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn every_fourth_sample_stays_the_first_included() {
        let mut decimator = Decimator::new(4);
        let kept: Vec<usize> = (0..12).filter(|_| decimator.keeps_next()).collect();
        assert_eq!(kept, [0, 4, 8]);
    }
}
