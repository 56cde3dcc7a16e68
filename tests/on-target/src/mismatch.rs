//! Compares computed with expected numbers, and describes the first difference.

use core::fmt;

/// The first computed number that differs from the expected number, or a wrong length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mismatch {
    /// What the compared numbers are, for example "values".
    pub what: &'static str,
    /// Index of the number that differs; `None` if there are too few or too many numbers.
    pub index: Option<usize>,
    /// The expected number or, without an index, how many numbers were expected.
    pub expected: i64,
    /// The computed number or, without an index, how many numbers were computed.
    pub got: i64,
}

impl Mismatch {
    /// Adds `before`, the total length of the slices before this one, to the index.
    pub(crate) fn offset_by(self, before: usize) -> Self {
        Self { index: self.index.map(|index| before + index), ..self }
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, index, expected, got } = self;
        match index {
            Some(index) => write!(f, "{what} {index}: got {got}, expected {expected}"),
            None => write!(f, "{what}: got {got} of them, expected {expected}"),
        }
    }
}

/// Checks that both slices hold the same numbers.
///
/// # Errors
/// Returns the first difference, or both lengths if only the lengths differ.
pub(crate) fn expect_equal<T: Copy + Into<i64>>(
    what: &'static str,
    expected: &[T],
    got: &[T],
) -> Result<(), Mismatch> {
    expect_near(what, 0, expected, got)
}

/// Checks that each number differs from the expected one by at most `tolerance`.
///
/// # Errors
/// Returns the first larger difference, or both lengths if only the lengths differ.
pub(crate) fn expect_near<T: Copy + Into<i64>>(
    what: &'static str,
    tolerance: u64,
    expected: &[T],
    got: &[T],
) -> Result<(), Mismatch> {
    let pairs = expected.iter().zip(got).enumerate();
    for (index, (&expected, &got)) in pairs {
        let (expected, got) = (expected.into(), got.into());
        if expected.abs_diff(got) > tolerance {
            return Err(Mismatch { what, index: Some(index), expected, got });
        }
    }
    if expected.len() == got.len() {
        return Ok(());
    }
    let [expected, got] = [expected, got].map(|all| i64::try_from(all.len()).unwrap_or(i64::MAX));
    Err(Mismatch { what, index: None, expected, got })
}

#[cfg(test)]
mod tests {
    use std::borrow::ToOwned;
    use std::string::ToString;

    use super::*;

    #[test]
    fn the_first_number_beyond_the_tolerance_or_a_wrong_count_is_a_mismatch() {
        let text = |tolerance, expected: &[i32], got: &[i32]| {
            let compared = expect_near("values", tolerance, expected, got);
            compared.err().map(|mismatch| mismatch.offset_by(128).to_string())
        };
        let differs = Some("values 130: got 7, expected 3".to_owned());
        assert_eq!(text(0, &[1, 2, 3], &[1, 2, 7]), differs);
        let too_few = Some("values: got 1 of them, expected 2".to_owned());
        assert_eq!(text(0, &[1, 2], &[1]), too_few);
        assert!(text(0, &[], &[1]).is_some());
        assert_eq!(text(2, &[10], &[12]), None);
        assert!(text(2, &[10], &[13]).is_some());
    }
}
