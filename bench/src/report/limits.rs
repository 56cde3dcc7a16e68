//! Limits of the figures, from `bench/limits.toml`.

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;

use super::checked_in;
use super::failure::Failure;
use super::value::Value;

/// Limits of one benchmark by the name of the figure.
pub(crate) type Limits = BTreeMap<String, Limit>;

/// Limit of one figure.
#[derive(Debug, Deserialize)]
pub(crate) struct Limit {
    #[serde(flatten)]
    pub(crate) bound: Bound,
    /// Measured value or purpose of the limit.
    pub(crate) reason: String,
}

/// Values that a figure can have.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Bound {
    AtMost(f64),
    AtLeast(f64),
    Is(bool),
}

impl Bound {
    /// Whether a value is within the bound. NaN is not; a figure that this PC cannot measure is.
    pub(crate) fn contains(self, value: Value) -> bool {
        #[expect(clippy::cast_precision_loss, reason = "counts are below 2^53")]
        let number = match value {
            Value::Missing => return true,
            Value::Flag(flag) => return matches!(self, Self::Is(wanted) if wanted == flag),
            Value::Count(count) => count as f64,
            Value::Real(number) => number,
        };
        match self {
            Self::AtMost(most) => number <= most,
            Self::AtLeast(least) => number >= least,
            Self::Is(_) => false,
        }
    }
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtMost(most) => write!(f, "at most {most}"),
            Self::AtLeast(least) => write!(f, "at least {least}"),
            Self::Is(flag) => write!(f, "{flag}"),
        }
    }
}

/// Returns the checked-in limits of one benchmark.
///
/// # Errors
/// `limits.toml` is malformed or has no table for the benchmark.
pub(crate) fn read(benchmark: &str) -> Result<Limits, Failure> {
    let text = include_str!("../../limits.toml");
    let mut tables: BTreeMap<String, Limits> = checked_in::parse("limits.toml", text)?;
    tables.remove(benchmark).ok_or_else(|| {
        let why = format!("no table [{benchmark}]");
        Failure::new("reading bench/limits.toml", why, "add the table")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_includes_its_end_and_excludes_what_is_no_number() {
        assert!(Bound::AtMost(58.0).contains(58.0.into()));
        assert!(!Bound::AtMost(58.0).contains(58.1.into()));
        assert!(!Bound::AtMost(58.0).contains(f64::NAN.into()));
        assert!(Bound::AtLeast(0.0).contains(0_u32.into()));
        assert!(!Bound::AtLeast(0.0).contains((-1_i64).into()));
        assert!(!Bound::AtLeast(0.0).contains(f64::NAN.into()));
        assert!(Bound::Is(true).contains(true.into()));
        assert!(!Bound::Is(true).contains(false.into()));
        assert!(!Bound::Is(true).contains(1_u32.into()));
        assert!(Bound::AtMost(1.0).contains(None.into()));
    }

    #[test]
    fn every_benchmark_has_limits() {
        for (benchmark, count) in [("filters", 5), ("encoder", 10), ("host", 2)] {
            let limits = read(benchmark).expect("limits.toml");
            assert_eq!(limits.len(), count, "{benchmark}");
        }
        assert!(read("nothing").is_err());
    }
}
