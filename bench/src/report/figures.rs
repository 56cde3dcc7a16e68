//! Figures of one benchmark: as JSON, as tables, and compared with their limits.

use std::fmt;

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::Value as Json;

use super::failure::Failure;
use super::limits::Limits;
use super::table::Table;
use super::value::Value;

/// One named value.
#[derive(Debug)]
pub(crate) struct Figure {
    /// Key in JSON and in `limits.toml`.
    name: &'static str,
    /// Empty for a flag.
    unit: &'static str,
    pub(crate) value: Value,
    /// Part or machine that the value belongs to; empty for a key of the JSON object.
    place: String,
    /// Names what makes a flag false, for the message.
    pub(crate) blamed: String,
    /// Bound in words, once the figure has been judged.
    limit: String,
}

/// Everything that one benchmark has measured.
#[derive(Debug)]
pub(crate) struct Report {
    /// Word on the command line, and table in `limits.toml`.
    benchmark: &'static str,
    /// What to do when a limit is exceeded.
    next: &'static str,
    figures: Vec<Figure>,
    /// Keys of the JSON object that are not judged, with nested values.
    details: Vec<(&'static str, Json)>,
    /// Tables that follow the table of figures.
    tables: Vec<Table>,
    /// Exceeded limits in words.
    faults: Vec<String>,
}

impl Report {
    pub(crate) fn new(benchmark: &'static str, next: &'static str) -> Self {
        Self {
            benchmark,
            next,
            figures: Vec::new(),
            details: Vec::new(),
            tables: Vec::new(),
            faults: Vec::new(),
        }
    }

    /// Adds a figure, which is also a key of the JSON object.
    pub(crate) fn figure(
        &mut self,
        name: &'static str,
        unit: &'static str,
        value: impl Into<Value>,
    ) -> &mut Figure {
        self.figure_of(String::new(), name, unit, value)
    }

    /// Adds a figure of a part or machine. It is judged; its key in the JSON object is in a detail.
    pub(crate) fn figure_of(
        &mut self,
        place: String,
        name: &'static str,
        unit: &'static str,
        value: impl Into<Value>,
    ) -> &mut Figure {
        let value = value.into();
        self.figures.push(Figure {
            name,
            unit,
            value,
            place,
            blamed: String::new(),
            limit: String::new(),
        });
        let last = self.figures.len() - 1;
        &mut self.figures[last]
    }

    /// Adds a key of the JSON object that is not judged.
    pub(crate) fn detail(&mut self, key: &'static str, value: impl Into<Json>) {
        self.details.push((key, value.into()));
    }

    pub(crate) fn table(&mut self, table: Table) {
        self.tables.push(table);
    }

    /// Compares all figures with their limits and notes the exceeded ones.
    pub(crate) fn judge(&mut self, limits: &Limits) {
        self.faults.clear();
        for figure in &mut self.figures {
            let Some(limit) = limits.get(figure.name) else {
                continue;
            };
            figure.limit = limit.bound.to_string();
            if !limit.bound.contains(figure.value) {
                self.faults.push(format!(
                    "{}; the limit is {} ({})",
                    figure, limit.bound, limit.reason
                ));
            }
        }
        let is_measured = |name: &&String| self.figures.iter().any(|figure| figure.name == **name);
        for name in limits.keys().filter(|name| !is_measured(name)) {
            self.faults
                .push(format!("limits.toml names {name}, which is not measured"));
        }
    }

    /// Replaces the value of a figure.
    #[cfg(test)]
    pub(crate) fn set(&mut self, name: &str, value: impl Into<Value>) {
        let figure = self.figures.iter_mut().find(|figure| figure.name == name);
        figure.expect("a figure").value = value.into();
    }

    /// # Errors
    /// Names the exceeded limits.
    pub(crate) fn outcome(&self) -> Result<(), Failure> {
        if self.faults.is_empty() {
            return Ok(());
        }
        Err(Failure::new(
            format!("the benchmark `{}`", self.benchmark),
            self.faults.join("; "),
            self.next,
        ))
    }
}

impl Serialize for Report {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for figure in self.figures.iter().filter(|figure| figure.place.is_empty()) {
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
        if !self.place.is_empty() {
            write!(f, " of {}", self.place)?;
        }
        write!(f, " is {}", self.value)?;
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
        let mut figures = Table::new(format!("Figures of `{}` and their limits", self.benchmark));
        for figure in &self.figures {
            let name = format!("{} {}", figure.name, figure.place);
            let cells = [
                figure.value.to_string(),
                figure.unit.into(),
                figure.limit.clone(),
            ];
            figures.row(name.trim_end(), cells);
        }
        write!(f, "{figures}")?;
        for table in &self.tables {
            write!(f, "\n{table}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits;
    use super::*;

    fn report(value: impl Into<Value>) -> Report {
        let mut report = Report::new("host", "look there");
        report
            .figure("int8_rms_steps", "steps of a code", value)
            .blamed = "code 5".to_owned();
        report.figure("torch_relative", "", None);
        report.detail("arch", "x86_64");
        report
    }

    fn judged(value: impl Into<Value>) -> Report {
        let mut report = report(value);
        report.judge(&limits::read("host").expect("limits.toml"));
        report
    }

    #[test]
    fn an_exceeded_limit_is_named_with_value_bound_and_next_step() {
        assert!(judged(4.0).outcome().is_ok());
        let failure = judged(4.5).outcome().expect_err("above 4").to_string();
        for words in [
            "int8_rms_steps is 4.5 steps of a code (code 5); the limit is at most 4",
            "next: look there",
        ] {
            assert!(failure.contains(words), "{failure}");
        }
        assert!(judged(f64::NAN).outcome().is_err());
    }

    #[test]
    fn a_limit_whose_figure_is_not_measured_is_a_fault() {
        let mut report = report(1.0);
        report.judge(&limits::read("filters").expect("limits.toml"));
        assert_eq!(report.faults.len(), 5, "{:?}", report.faults);
        assert!(report.faults[0].contains("bits_equal, which is not measured"));
    }

    #[test]
    fn the_json_is_one_object_with_figures_details_and_faults() {
        let text = serde_json::to_string(&judged(4.5)).expect("JSON");
        assert!(text.starts_with(r#"{"int8_rms_steps":4.5,"torch_relative":null,"arch":"x86_64","#));
        let json: Json = serde_json::from_str(&text).expect("JSON");
        assert_eq!(json["faults"].as_array().map(Vec::len), Some(1));
        assert!(!text.contains('\n'));
    }

    #[test]
    fn the_table_shows_each_figure_with_unit_and_limit() {
        let text = judged(1.5).to_string();
        assert!(text.contains("int8_rms_steps"), "{text}");
        assert!(text.contains("steps of a code    at most 4"), "{text}");
        assert!(text.contains("not measured"), "{text}");
    }
}
