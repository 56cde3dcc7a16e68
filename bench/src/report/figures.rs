//! Figures of one benchmark: as JSON, as tables, and compared with their limits.

use std::fmt;

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value as Json;

use super::failure::Failure;
use super::limits::Limits;
use super::table;

/// One named value of a benchmark, with its limit once it has been judged.
#[derive(Debug)]
struct Figure {
    /// Key in JSON and in `limits.toml`.
    name: &'static str,
    /// Unit of the value; empty for a flag.
    unit: &'static str,
    value: Json,
    /// Microcontroller that the value belongs to; empty for a key of the JSON object.
    part: String,
    /// Names of the cases that make a flag false; empty if it is true.
    blamed: String,
    /// False if this PC lacks a tool to measure the figure.
    is_measured: bool,
    /// Limit in words, set when the figure is judged.
    limit: String,
}

/// Figures and details of one run of a benchmark.
#[derive(Debug)]
pub(crate) struct Report {
    /// Name of the benchmark on the command line, and of its table in `limits.toml`.
    benchmark: &'static str,
    /// What the user should do if a limit is exceeded.
    next: &'static str,
    figures: Vec<Figure>,
    /// Further entries of the JSON object, with nested values; no limit applies to them.
    details: Vec<(&'static str, Json)>,
    /// One sentence for each exceeded limit.
    faults: Vec<String>,
}

impl Report {
    pub(crate) fn new(benchmark: &'static str, next: &'static str) -> Self {
        Self {
            benchmark,
            next,
            figures: Vec::new(),
            details: Vec::new(),
            faults: Vec::new(),
        }
    }

    /// Adds a figure, which is also a key of the JSON object.
    pub(crate) fn figure(
        &mut self,
        name: &'static str,
        unit: &'static str,
        value: impl Into<Json>,
    ) {
        self.figures.push(Figure {
            name,
            unit,
            value: value.into(),
            part: String::new(),
            blamed: String::new(),
            is_measured: true,
            limit: String::new(),
        });
    }

    /// Adds a figure that is `null`, and not judged, if this PC lacks a tool to measure it.
    pub(crate) fn optional(&mut self, name: &'static str, unit: &'static str, value: Option<f64>) {
        self.figure(name, unit, value);
        self.last().is_measured = value.is_some();
    }

    /// Adds a flag that is true when `blamed` is empty.
    pub(crate) fn flag(&mut self, name: &'static str, blamed: String) {
        self.figure(name, "", blamed.is_empty());
        self.last().blamed = blamed;
    }

    /// Adds the number of bytes that the program leaves free on a microcontroller. The figure is
    /// judged, but it is no key of the JSON object: a detail contains it.
    pub(crate) fn part_figure(&mut self, part: &str, name: &'static str, bytes_left: i64) {
        self.figure(name, "bytes", bytes_left);
        part.clone_into(&mut self.last().part);
    }

    fn last(&mut self) -> &mut Figure {
        let last = self.figures.len() - 1;
        &mut self.figures[last]
    }

    /// Adds an entry to the JSON object to which no limit applies.
    pub(crate) fn detail(&mut self, key: &'static str, value: impl Into<Json>) {
        self.details.push((key, value.into()));
    }

    /// Compares all figures with their limits and notes the exceeded ones.
    pub(crate) fn judge(&mut self, limits: &Limits) {
        for figure in &mut self.figures {
            let Some(limit) = limits.get(figure.name) else {
                continue;
            };
            figure.limit = limit.bound.to_string();
            if figure.is_measured && !limit.bound.contains(&figure.value) {
                let (bound, reason) = (limit.bound, &limit.reason);
                let fault = format!("{figure}; the limit is {bound} ({reason})");
                self.faults.push(fault);
            }
        }
        for name in limits.keys() {
            if !self.figures.iter().any(|figure| figure.name == name) {
                let fault = format!("limits.toml names {name}, which is not measured");
                self.faults.push(fault);
            }
        }
    }

    /// Returns a failure that names the exceeded limits, if there are any.
    pub(crate) fn outcome(&self) -> Result<(), Failure> {
        if self.faults.is_empty() {
            return Ok(());
        }
        let what = format!("the benchmark `{}`", self.benchmark);
        Err(Failure::new(what, self.faults.join("; "), self.next))
    }
}

impl Serialize for Report {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for figure in self.figures.iter().filter(|figure| figure.part.is_empty()) {
            map.serialize_entry(figure.name, &figure.value)?;
        }
        for (key, value) in &self.details {
            map.serialize_entry(key, value)?;
        }
        map.serialize_entry("faults", &self.faults)?;
        map.end()
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)?;
        if !self.part.is_empty() {
            write!(f, " of {}", self.part)?;
        }
        write!(f, " is {}", table::cell(&self.value))?;
        if !self.unit.is_empty() {
            write!(f, " {}", self.unit)?;
        }
        if !self.blamed.is_empty() {
            write!(f, " ({})", self.blamed)?;
        }
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rows = vec![["", "value", "unit", "limit"].map(str::to_owned).to_vec()];
        for figure in &self.figures {
            let name = [figure.name, &figure.part].join(" ").trim_end().to_owned();
            let value = table::cell(&figure.value);
            rows.push(vec![
                name,
                value,
                figure.unit.to_owned(),
                figure.limit.clone(),
            ]);
        }
        f.write_str(&table::table(self.benchmark, &rows))?;
        for (key, value) in &self.details {
            f.write_str(&table::tables(key, value))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits;
    use super::*;

    impl Report {
        pub(crate) fn set(&mut self, name: &str, value: impl Into<Json>) {
            let figure = self.figures.iter_mut().find(|figure| figure.name == name);
            figure.expect("a figure").value = value.into();
        }

        /// Judges the report and returns its faults.
        pub(crate) fn faults(mut self) -> Vec<String> {
            let limits = limits::read(self.benchmark).expect("limits.toml");
            self.judge(&limits);
            assert_eq!(self.outcome().is_err(), !self.faults.is_empty());
            self.faults
        }

        pub(crate) fn json(&self) -> Json {
            let text = serde_json::to_string(self).expect("JSON");
            assert!(!text.contains('\n'));
            serde_json::from_str(&text).expect("JSON")
        }
    }

    fn report(value: f64) -> Report {
        let mut report = Report::new("host", "look there");
        report.figure("int8_rms_steps", "steps", value);
        report.last().blamed = "code 5".to_owned();
        report.optional("torch_relative", "", None);
        report.detail("arch", "x86_64");
        report
    }

    #[test]
    fn an_exceeded_limit_is_named_with_value_bound_and_next_step() {
        assert!(report(4.0).faults().is_empty());
        assert_eq!(report(f64::NAN).faults().len(), 1);
        let mut report = report(4.5);
        report.judge(&limits::read("host").expect("limits.toml"));
        let failure = report.outcome().expect_err("above 4").to_string();
        for words in [
            "`host` failed: int8_rms_steps is 4.5 steps (code 5); the limit is at most 4 (",
            "\n  next: look there",
        ] {
            assert!(failure.contains(words), "{failure}");
        }
        let json = report.json();
        assert_eq!(json["int8_rms_steps"], 4.5);
        assert!(json["torch_relative"].is_null() && json["arch"] == "x86_64");
        assert_eq!(json["faults"].as_array().map(Vec::len), Some(1));
        let text = report.to_string();
        assert!(text.contains("4.5    steps          at most 4\n"), "{text}");
    }

    #[test]
    fn an_optional_figure_is_judged_where_it_is_measured() {
        for (value, faults) in [(1e-7, 0), (0.1, 1), (f64::NAN, 1)] {
            let mut report = report(1.0);
            report.figures.pop();
            report.optional("torch_relative", "", Some(value));
            assert_eq!(report.faults().len(), faults, "{value}");
        }
    }

    #[test]
    fn a_limit_whose_figure_is_not_measured_is_a_fault() {
        let mut report = report(1.0);
        report.figures.remove(0);
        let faults = report.faults();
        assert_eq!(
            faults,
            ["limits.toml names int8_rms_steps, which is not measured"]
        );
    }
}
