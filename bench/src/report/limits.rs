//! Limits of the figures, from `bench/limits.toml`.

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;
use serde_json::Value as Json;

use super::checked_in;
use super::failure::Failure;

/// Limits of one benchmark by the name of the figure.
pub(crate) type Limits = BTreeMap<String, Limit>;

#[derive(Debug, Deserialize)]
pub(crate) struct Limit {
    #[serde(flatten)]
    pub(crate) bound: Bound,
    /// Measured value or purpose of the limit.
    pub(crate) reason: String,
}

/// Range of values within which a figure must be.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Bound {
    AtMost(f64),
    AtLeast(f64),
    Is(bool),
}

impl Bound {
    /// Returns whether a figure is within the limit. NaN, which is `null` in JSON, is not.
    pub(crate) fn contains(self, figure: &Json) -> bool {
        match self {
            Self::AtMost(most) => figure.as_f64().is_some_and(|number| number <= most),
            Self::AtLeast(least) => figure.as_f64().is_some_and(|number| number >= least),
            Self::Is(flag) => *figure == Json::Bool(flag),
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

/// Reads the limits of one benchmark.
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
    fn every_limit_includes_its_end_and_excludes_what_is_beyond_or_no_number() {
        let limits = [
            ("filters", "insn_per_sample_channel", 58.0, 58.1),
            ("filters", "noise_nv_rms", 2.6, 2.61),
            ("filters", "ratio_idsp_dither", 2.0, 1.99),
            ("encoder", "insn_per_code", 1_100_000.0, 1_100_001.0),
            (
                "encoder",
                "insn_per_code_shortcut",
                1_230_000.0,
                1_230_001.0,
            ),
            ("encoder", "insn_after_last_sample", 148_000.0, 148_001.0),
            ("encoder", "worst_over_mean", 1.2, 1.201),
            ("encoder", "ram_bytes", 48_000.0, 48_001.0),
            ("encoder", "flash_bytes", 400_000.0, 400_001.0),
            ("encoder", "flash_left", 0.0, -1.0),
            ("encoder", "ram_left", 0.0, -1.0),
            ("host", "int8_rms_steps", 4.0, 4.001),
            ("host", "torch_relative", 1e-5, 1.1e-5),
        ];
        let flags = [
            ("filters", "constant_count"),
            ("filters", "bits_equal"),
            ("encoder", "constant_count"),
            ("encoder", "bytes_equal"),
        ];
        let contains = |benchmark, figure: &str, value: Json| {
            let bound = read(benchmark).expect("limits.toml")[figure].bound;
            bound.contains(&value)
        };
        for (benchmark, figure, good, bad) in limits {
            assert!(contains(benchmark, figure, good.into()), "{figure}");
            assert!(!contains(benchmark, figure, bad.into()), "{figure}");
            assert!(!contains(benchmark, figure, f64::NAN.into()), "{figure}");
        }
        for (benchmark, figure) in flags {
            assert!(contains(benchmark, figure, true.into()), "{figure}");
            assert!(!contains(benchmark, figure, false.into()), "{figure}");
        }
        let all = ["filters", "encoder", "host"].map(|name| read(name).expect("a table").len());
        let listed = limits.len() + flags.len();
        assert_eq!(all.iter().sum::<usize>(), listed);
        assert!(read("nothing").is_err());
    }
}
