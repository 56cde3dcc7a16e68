//! Text of `docs/figures.md`: every measured figure once, with the command that printed it.

use std::fmt::Write as _;

use serde::Deserialize;
use serde_json::Value;

/// Description of the page, read from `docs/figures.toml`: its figures in their order.
#[derive(Debug, Deserialize)]
pub(crate) struct FiguresPage {
    #[serde(rename = "section")]
    pub(crate) sections: Vec<Section>,
}

/// Figures that one command prints.
#[derive(Debug, Deserialize)]
pub(crate) struct Section {
    title: String,
    /// Arguments of `cargo xtask`; with `--json` added, the command prints one JSON object.
    pub(crate) command: String,
    note: String,
    #[serde(rename = "figure")]
    figures: Vec<Figure>,
}

/// One row of the page: a figure and where to find it.
#[derive(Debug, Deserialize)]
struct Figure {
    name: String,
    /// Place of the value in the command's JSON object (JSON pointer, RFC 6901).
    pointer: String,
    #[serde(default)]
    unit: String,
    /// Factor from the unit in the JSON object to `unit`.
    #[serde(default = "one")]
    scale: f64,
    /// Digits after the decimal point on the page.
    #[serde(default)]
    decimals: usize,
    /// Largest accepted difference between the page and another run, as a fraction of the value.
    #[serde(default)]
    tolerance: f64,
    /// Whether the figure may be absent, because a run without some tool does not measure it.
    #[serde(default)]
    optional: bool,
}

fn one() -> f64 {
    1.0
}

impl Section {
    /// Returns the section's Markdown; `source` names the commit and date of the measurement.
    ///
    /// # Errors
    /// Names of the figures that `measured` lacks.
    pub(crate) fn markdown(&self, measured: &Value, source: &str) -> Result<String, Vec<String>> {
        let values: Vec<Option<f64>> = self.figures.iter().map(|f| f.value(measured)).collect();
        let missing = self.figures.iter().zip(&values);
        let missing: Vec<String> = missing
            .filter(|(_, value)| value.is_none())
            .map(|(figure, _)| figure.name.clone())
            .collect();
        if !missing.is_empty() {
            return Err(missing);
        }
        let mut page = format!("\n## {}\n\n{}\n\n", self.title, self.note);
        let _ = writeln!(page, "`cargo xtask {} --json`, {source}\n", self.command);
        page += "| Figure | Value | Unit |\n| --- | ---: | --- |\n";
        for (figure, value) in self.figures.iter().zip(values.into_iter().flatten()) {
            let value = grouped(value, figure.decimals);
            let _ = writeln!(page, "| {} | {value} | {} |", figure.name, figure.unit);
        }
        Ok(page)
    }

    /// Returns one line for each figure that `page` lacks, or for which `page` and `measured`
    /// differ.
    pub(crate) fn differences(&self, page: &str, measured: &Value) -> Vec<String> {
        let section = page
            .split("\n## ")
            .find(|text| text.starts_with(&self.title));
        let section = section.unwrap_or_default();
        let differences = self.figures.iter().map(|figure| {
            let row = format!("| {} | ", figure.name);
            let stated = section.lines().find_map(|line| line.strip_prefix(&row));
            let stated = stated.and_then(|rest| rest.split(" |").next());
            let number = stated.and_then(|text| text.replace(',', "").parse::<f64>().ok());
            match (number, figure.value(measured)) {
                (Some(stated), Some(now)) if figure.agree(stated, now) => None,
                (Some(_), None) if figure.optional => None,
                (_, now) => Some(format!(
                    "{}, {}: the page states {}, this run measured {}",
                    self.title,
                    figure.name,
                    stated.unwrap_or("nothing"),
                    now.map_or("nothing".to_owned(), |now| grouped(now, figure.decimals)),
                )),
            }
        });
        differences.flatten().collect()
    }
}

impl Figure {
    fn value(&self, measured: &Value) -> Option<f64> {
        Some(measured.pointer(&self.pointer)?.as_f64()? * self.scale)
    }

    /// Returns whether the value on the page and a new one differ by no more than the tolerance and
    /// the rounding of the page.
    fn agree(&self, stated: f64, now: f64) -> bool {
        let digits = i32::try_from(self.decimals).unwrap_or(i32::MAX);
        (stated - now).abs() <= now.abs() * self.tolerance + 0.5001 * 10_f64.powi(-digits)
    }
}

/// Formats a number with commas between groups of three digits: "1,224,652", "-1,000.50".
fn grouped(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    let mut number = String::from(if value < 0.0 { "-" } else { "" });
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index) % 3 == 0 {
            number.push(',');
        }
        number.push(digit);
    }
    if !fraction.is_empty() {
        number.push('.');
        number += fraction;
    }
    number
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn section() -> Section {
        let text = r#"
            [[section]]
            title = "Encoder"
            command = "bench encoder"
            note = "The checked-in model."
            [[section.figure]]
            name = "instructions per code"
            pointer = "/machines/0/insn"
            tolerance = 0.001
            [[section.figure]]
            name = "worst step"
            pointer = "/worst_ns"
            unit = "ms"
            scale = 1e-6
            decimals = 2
            tolerance = 0.1
            [[section.figure]]
            name = "cycles"
            pointer = "/cycles"
            optional = true"#;
        let mut page: FiguresPage = toml::from_str(text).expect("a page");
        page.sections.remove(0)
    }

    #[test]
    fn a_page_agrees_with_the_run_that_wrote_it() {
        let measured =
            json!({ "machines": [{ "insn": 1_224_652 }], "worst_ns": 3_030_200, "cycles": 7 });
        let page = section()
            .markdown(&measured, "commit abc")
            .expect("figures");
        assert!(
            page.contains("| instructions per code | 1,224,652 |  |"),
            "{page}"
        );
        assert!(page.contains("| worst step | 3.03 | ms |"), "{page}");
        assert_eq!(section().differences(&page, &measured), [""; 0]);
    }

    #[test]
    fn a_figure_outside_its_tolerance_is_named_with_both_values() {
        let measured =
            json!({ "machines": [{ "insn": 1_000_000 }], "worst_ns": 3_000_000, "cycles": 7 });
        let page = section().markdown(&measured, "").expect("figures");
        let later = json!({ "machines": [{ "insn": 1_002_000 }], "worst_ns": 3_200_000 });
        let differences = section().differences(&page, &later);
        assert_eq!(
            differences,
            [
                "Encoder, instructions per code: the page states 1,000,000, this run measured 1,002,000"
            ]
        );
    }

    #[test]
    fn a_figure_that_was_not_measured_is_missing_and_not_zero() {
        let measured = json!({ "machines": [], "worst_ns": null });
        let missing = section()
            .markdown(&measured, "")
            .expect_err("nothing is there");
        assert_eq!(missing, ["instructions per code", "worst step", "cycles"]);
        assert_eq!(section().differences("", &measured).len(), 3);
    }

    #[test]
    fn digits_are_in_groups_of_three() {
        assert_eq!(grouped(1_095_740.0, 0), "1,095,740");
        assert_eq!(grouped(-1_000.5, 2), "-1,000.50");
        assert_eq!(grouped(56.0, 1), "56.0");
    }
}
