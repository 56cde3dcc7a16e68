//! A measured value.

use std::fmt;

/// One measured number or yes-no answer.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(untagged)]
pub(crate) enum Value {
    /// Answer to a yes-no question.
    Flag(bool),
    /// Exact number.
    Count(i64),
    /// Number that was computed; it can be NaN.
    Real(f64),
    /// Not measured because this PC lacks a tool; `null` in JSON.
    Missing,
}

impl From<bool> for Value {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl From<u32> for Value {
    fn from(count: u32) -> Self {
        Self::Count(count.into())
    }
}

impl From<i64> for Value {
    fn from(count: i64) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Value {
    fn from(count: usize) -> Self {
        Self::Count(i64::try_from(count).unwrap_or(i64::MAX))
    }
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Real(number)
    }
}

impl From<Option<f64>> for Value {
    fn from(number: Option<f64>) -> Self {
        number.map_or(Self::Missing, Self::Real)
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Count(count) => write!(f, "{count}"),
            Self::Real(number) if *number != 0.0 && number.abs() < 0.01 => write!(f, "{number:.1e}"),
            // At most three decimals, without trailing zeros.
            Self::Real(number) => write!(f, "{}", (number * 1000.0).round() / 1000.0),
            Self::Missing => f.write_str("not measured"),
        }
    }
}
