//! Text of `docs/figures.md`: every measured figure once, with the command that printed it.

use serde::Deserialize;
use serde_json::Value;

/// Description of docs/figures.md, read from `docs/figures.toml`: its sections in the order of the
/// page.
#[derive(Debug, Deserialize)]
pub(crate) struct FiguresPage {
    #[serde(rename = "section")]
    pub(crate) sections: Vec<Section>,
}

/// Section of the page: the figures that one command measures.
#[derive(Debug, Deserialize)]
pub(crate) struct Section {
    title: String,
    /// Arguments of `cargo xtask`; with `--json` added, the command prints one JSON object.
    pub(crate) command: String,
    note: String,
    #[serde(rename = "figure")]
    figures: Vec<Figure>,
}

/// One row of a section's table; the comment at the top of docs/figures.toml describes the fields.
#[derive(Debug, Deserialize)]
struct Figure {
    name: String,
    pointer: String,
    #[serde(default)]
    unit: String,
    scale: Option<f64>,
    #[serde(default)]
    decimals: usize,
    #[serde(default)]
    tolerance: f64,
    #[serde(default)]
    optional: bool,
}

impl Section {
    /// Returns the section's Markdown; `source` names the commit and date of the measurement.
    ///
    /// # Errors
    /// `measured` lacks a figure; the error names the figure.
    pub(crate) fn markdown(&self, measured: &Value, source: &str) -> Result<String, String> {
        let rows = self.figures.iter().map(|figure| {
            let Figure { name, unit, .. } = figure;
            let value = figure.value(measured);
            let value = value.ok_or_else(|| format!("its object lacks: {name}"))?;
            let value = grouped(value, figure.decimals);
            Ok(format!("| {name} | {value} | {unit} |\n"))
        });
        let rows = rows.collect::<Result<String, String>>()?;
        Ok(format!(
            "\n## {}\n\n{}\n\n`cargo xtask {} --json`, {source}\n\n\
             | Figure | Value | Unit |\n| --- | ---: | --- |\n{rows}",
            self.title, self.note, self.command
        ))
    }

    /// Returns one line for each figure whose values in `page` and `measured` disagree, or that one
    /// of the two lacks. Only an optional figure may be absent from `measured`.
    pub(crate) fn differences(&self, page: &str, measured: &Value) -> Vec<String> {
        let mut sections = page.split("\n## ");
        let section = sections.find(|text| text.starts_with(&self.title));
        let section = section.unwrap_or_default();
        let differences = self.figures.iter().map(|figure| {
            let row = format!("| {} | ", figure.name);
            let stated = section.lines().find_map(|line| line.strip_prefix(&row));
            let stated = stated.and_then(|rest| rest.split(" |").next());
            let number = stated.and_then(|text| text.replace(',', "").parse::<f64>().ok());
            match (number, figure.value(measured)) {
                (Some(stated), Some(now)) if figure.agree(stated, now) => None,
                (Some(_), None) if figure.optional => None,
                (_, now) => {
                    let (title, name, page) =
                        (&self.title, &figure.name, stated.unwrap_or("nothing"));
                    let now = now.map_or("nothing".to_owned(), |now| grouped(now, figure.decimals));
                    Some(format!(
                        "{title}, {name}: the page states {page}, this run measured {now}"
                    ))
                }
            }
        });
        differences.flatten().collect()
    }
}

impl Figure {
    fn value(&self, measured: &Value) -> Option<f64> {
        Some(measured.pointer(&self.pointer)?.as_f64()? * self.scale.unwrap_or(1.0))
    }

    /// Returns whether a new value equals the value on the page within the tolerance plus the
    /// page's rounding.
    fn agree(&self, stated: f64, now: f64) -> bool {
        let digits = i32::try_from(self.decimals).unwrap_or(i32::MAX);
        (stated - now).abs() <= now.abs() * self.tolerance + 0.5001 * 10_f64.powi(-digits)
    }
}

/// Formats a number with commas between groups of three digits: "1,224,652", "-1,000.50".
fn grouped(value: f64, decimals: usize) -> String {
    let mut number = format!("{value:.decimals$}");
    let first_digit = usize::from(value < 0.0);
    let mut comma = number.find('.').unwrap_or(number.len());
    while comma > first_digit + 3 {
        comma -= 3;
        number.insert(comma, ',');
    }
    number
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn section() -> Section {
        let text = r#"
            title = "Encoder"
            command = "bench encoder"
            note = "The checked-in model."
            figure = [
                { name = "instructions per code", pointer = "/machines/0/insn", tolerance = 0.001 },
                { name = "worst step", pointer = "/ns", unit = "ms", scale = 1e-6, decimals = 2, tolerance = 0.1 },
                { name = "cycles", pointer = "/cycles", optional = true },
            ]"#;
        toml::from_str(text).expect("a section")
    }

    #[test]
    fn a_page_agrees_with_the_run_that_wrote_it_and_names_what_differs_from_another() {
        let measured = json!({"machines": [{"insn": 1_000_000}], "ns": 3_030_200, "cycles": 7});
        let page = section()
            .markdown(&measured, "commit abc")
            .expect("figures");
        let rows = "| instructions per code | 1,000,000 |  |\n| worst step | 3.03 | ms |\n";
        assert!(page.contains(rows), "{page}");
        assert_eq!(section().differences(&page, &measured), [""; 0]);
        // The worst step has changed by 6 % (tolerance 10 %), and the missing cycles are optional.
        let later = json!({"machines": [{"insn": 1_002_000}], "ns": 3_200_000});
        let expected = "Encoder, instructions per code: the page states 1,000,000, this run measured 1,002,000";
        assert_eq!(section().differences(&page, &later), [expected]);
    }

    #[test]
    fn a_figure_that_was_not_measured_is_missing_and_not_zero() {
        let measured = json!({"machines": [], "ns": null});
        let missing = section().markdown(&measured, "");
        let expected = "its object lacks: instructions per code";
        assert_eq!(missing.err().as_deref(), Some(expected));
        assert_eq!(section().differences("", &measured).len(), 3);
    }

    #[test]
    fn digits_are_in_groups_of_three() {
        let numbers = [(1_095_740.0, 0), (-1_000.5, 2), (-100.0, 0), (56.0, 1)];
        let formatted = numbers.map(|(value, decimals)| grouped(value, decimals));
        assert_eq!(formatted, ["1,095,740", "-1,000.50", "-100", "56.0"]);
    }
}
