//! Where a device and a golden vector part.

use core::fmt;

/// The first number that is not the expected one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mismatch {
    /// What the numbers are.
    pub what: &'static str,
    /// Which of them; none where there are too few or too many.
    pub index: Option<usize>,
    /// What it, or their count, should be.
    pub expected: i64,
    /// What it is.
    pub got: i64,
}

impl Mismatch {
    /// The same, where so many numbers came before those that were compared.
    pub(crate) fn behind(self, before: usize) -> Self {
        Self {
            index: self.index.map(|index| before + index),
            ..self
        }
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            what,
            index,
            expected,
            got,
        } = self;
        match index {
            Some(index) => write!(f, "{what} {index}: got {got}, expected {expected}"),
            None => write!(f, "{what}: got {got} of them, expected {expected}"),
        }
    }
}

/// Whether both are the same, number by number.
///
/// # Errors
/// The first that is not, or the lengths.
pub(crate) fn same<T: Copy + Into<i64>>(
    what: &'static str,
    expected: &[T],
    got: &[T],
) -> Result<(), Mismatch> {
    near(what, 0, expected, got)
}

/// Whether no number is further from the expected one than `tolerance`.
///
/// # Errors
/// The first that is, or the lengths.
pub(crate) fn near<T: Copy + Into<i64>>(
    what: &'static str,
    tolerance: u64,
    expected: &[T],
    got: &[T],
) -> Result<(), Mismatch> {
    let pairs = expected.iter().zip(got).enumerate();
    for (index, (&expected, &got)) in pairs {
        let (expected, got) = (expected.into(), got.into());
        if expected.abs_diff(got) > tolerance {
            return Err(Mismatch {
                what,
                index: Some(index),
                expected,
                got,
            });
        }
    }
    if expected.len() == got.len() {
        return Ok(());
    }
    let [expected, got] = [expected, got].map(|all| i64::try_from(all.len()).unwrap_or(i64::MAX));
    Err(Mismatch {
        what,
        index: None,
        expected,
        got,
    })
}

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use super::*;

    #[test]
    fn one_bit_that_differs_is_named_with_its_place() {
        let mismatch = same("values", &[1_i32, 2, 3], &[1, 2, 7]).expect_err("they differ");
        assert_eq!(mismatch.to_string(), "values 2: got 7, expected 3");
        assert_eq!(
            mismatch.behind(128).to_string(),
            "values 130: got 7, expected 3"
        );
        assert_eq!(same("values", &[1_i32], &[1]), Ok(()));
    }

    #[test]
    fn numbers_that_are_missing_are_a_mismatch() {
        let mismatch = same("values", &[1_i32, 2], &[1]).expect_err("one is missing");
        assert_eq!(mismatch.to_string(), "values: got 1 of them, expected 2");
        assert!(same::<i32>("values", &[], &[1]).is_err());
    }

    #[test]
    fn a_tolerance_holds_to_its_end_and_no_further() {
        assert_eq!(near("values", 2, &[10_i32], &[12]), Ok(()));
        assert!(near("values", 2, &[10_i32], &[13]).is_err());
    }
}
