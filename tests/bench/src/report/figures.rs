//! Figures of one benchmark: compares them with their limits, and shows them as JSON or tables.

use std::collections::BTreeMap;
use std::fmt;

use anyhow::ensure;
use serde::Deserialize;
use serde_json::Value as Json;

use super::{checked_in, table};

/// Limits of one benchmark's figures, by the names of the figures.
type Limits = BTreeMap<String, Limit>;

#[derive(Debug, Deserialize)]
struct Limit {
    #[serde(flatten)]
    bound: Bound,
    /// Why the limit has this value: a measured value, or the purpose of the limit.
    reason: String,
    /// Whether the figure may be `null`, because a PC may lack the tool that measures it.
    #[serde(default)]
    optional: bool,
}

/// Values that a figure may have.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Bound {
    AtMost(f64),
    AtLeast(f64),
    Is(bool),
}

/// Report of one run of a benchmark: its figures, compared with their limits.
#[derive(Debug)]
pub(crate) struct Report {
    /// Name of the benchmark: its command, and its table in `limits.toml`.
    benchmark: &'static str,
    limits: Limits,
    /// The object that `--json` prints: figures, nested details, and `faults`.
    pub(crate) object: Json,
    /// One sentence for each figure that is beyond its limit.
    faults: Vec<String>,
    /// What the user should do if a figure is beyond its limit.
    next: &'static str,
}

impl Limit {
    /// Returns whether a figure is within the limit. `null`, which also stands for NaN, is within
    /// the limit only if the figure is optional.
    fn contains(&self, figure: &Json) -> bool {
        if figure.is_null() {
            return self.optional;
        }
        match self.bound {
            Bound::AtMost(most) => figure.as_f64().is_some_and(|number| number <= most),
            Bound::AtLeast(least) => figure.as_f64().is_some_and(|number| number >= least),
            Bound::Is(flag) => *figure == Json::Bool(flag),
        }
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.bound {
            Bound::AtMost(most) => write!(f, "at most {most}"),
            Bound::AtLeast(least) => write!(f, "at least {least}"),
            Bound::Is(flag) => write!(f, "{flag}"),
        }
    }
}

impl Report {
    /// Compares the figures in `object` with the limits of `benchmark` in `limits.toml`.
    ///
    /// # Errors
    /// The limits cannot be read.
    pub(crate) fn new(
        benchmark: &'static str,
        mut object: Json,
        next: &'static str,
    ) -> anyhow::Result<Self> {
        let text = include_str!("../../limits.toml");
        let limits: Limits = checked_in::table("limits.toml", text, benchmark)?;
        let mut faults = Vec::new();
        for (name, limit) in &limits {
            let Some(figure) = object.get(name) else {
                faults.push(format!("limits.toml names {name}, which is not measured"));
                continue;
            };
            if !limit.contains(figure) {
                let (figure, reason) = (table::cell(figure), &limit.reason);
                faults.push(format!("{name} is {figure}; the limit is {limit} ({reason})"));
            }
        }
        object["faults"] = faults.clone().into();
        Ok(Self { benchmark, limits, object, faults, next })
    }

    /// Returns an error that names all figures beyond their limits, if there are any.
    pub(crate) fn outcome(&self) -> anyhow::Result<()> {
        let (benchmark, faults, next) = (self.benchmark, self.faults.join("; "), self.next);
        ensure!(faults.is_empty(), "the benchmark `{benchmark}` failed: {faults}\n  next: {next}");
        Ok(())
    }
}

/// Returns the median of a figure over rounds, each of which times all contenders in turn; `None`
/// if a round lacks the figure.
///
/// Compute the ratio of two speeds within each round: other load of the PC slows all contenders of
/// a round equally. Speeds have no limits, because they depend on the PC.
pub(crate) fn median<R>(rounds: &[R], figure: &dyn Fn(&R) -> Option<f64>) -> Option<f64> {
    let mut figures: Vec<f64> = rounds.iter().map(figure).collect::<Option<_>>()?;
    figures.sort_by(f64::total_cmp);
    figures.get(figures.len() / 2).copied()
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rows = vec![["", "value", "limit"].map(str::to_owned).to_vec()];
        let mut details = String::new();
        for (name, value) in self.object.as_object().into_iter().flatten() {
            if table::is_nested(value) {
                details += &table::tables(name, value);
            } else {
                let limit = self.limits.get(name).map(ToString::to_string);
                rows.push(vec![name.clone(), table::cell(value), limit.unwrap_or_default()]);
            }
        }
        write!(f, "{}{details}", table::table(self.benchmark, &rows))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    impl Report {
        /// Returns the faults, one sentence each. Asserts first that `outcome` and `object` agree
        /// with them.
        pub(crate) fn faults(&self) -> &[String] {
            assert_eq!(self.outcome().is_err(), !self.faults.is_empty());
            assert_eq!(self.object["faults"], json!(self.faults));
            &self.faults
        }

        pub(crate) fn assert_only_fault(&self, words: &str) {
            let faults = self.faults();
            assert!(faults.len() == 1 && faults[0].contains(words), "{faults:?}");
        }
    }

    fn report(figures: Json) -> Report {
        Report::new("offline", figures, "look there").expect("limits.toml")
    }

    #[test]
    fn every_limit_includes_its_end_and_excludes_what_is_beyond_or_no_number() {
        let tables: BTreeMap<String, Limits> =
            toml::from_str(include_str!("../../limits.toml")).expect("tables of limits");
        for (figure, limit) in tables.into_values().flatten() {
            let [good, bad] = match limit.bound {
                Bound::AtMost(most) => [json!(most), json!(most + 0.001 * most.max(1.0))],
                Bound::AtLeast(least) => [json!(least), json!(least - 0.001)],
                Bound::Is(flag) => [json!(flag), json!(!flag)],
            };
            assert!(limit.contains(&good) && !limit.contains(&bad), "{figure}");
            let is_optional = limit.optional;
            assert_eq!(limit.contains(&json!(f64::NAN)), is_optional, "{figure}");
        }
        assert!(Report::new("nothing", json!({}), "").is_err());
    }

    #[test]
    fn a_slow_round_does_not_change_a_median_and_a_missing_figure_is_none() {
        assert_eq!(median(&[1.0, 1.1, 10.0], &|round| Some(*round)), Some(1.1));
        let present = |round: &f64| (*round < 10.0).then_some(*round);
        assert_eq!(median(&[1.0, 1.1, 10.0], &present), None);
    }

    #[test]
    fn an_exceeded_limit_is_named_with_value_bound_and_next_step() {
        let sound = report(json!({"prd_percent": 16.0, "torch_prd_percent": null, "list": [1, 2]}));
        assert_eq!(sound.faults(), [""; 0]);
        let text = sound.to_string();
        for words in ["  16    at most 16\n", "not measured", "\nlist: 1, 2\n"] {
            assert!(text.contains(words), "{text}");
        }
        let failure = report(json!({"prd_percent": 16.5})).outcome().expect_err("above 16");
        for words in [
            "`offline` failed: prd_percent is 16.5; the limit is at most 16 (",
            "limits.toml names torch_prd_percent, which is not measured\n  next: look there",
        ] {
            assert!(failure.to_string().contains(words), "{failure}");
        }
    }
}
