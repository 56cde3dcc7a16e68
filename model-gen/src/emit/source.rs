//! Builds Rust source text: items, arrays, and number literals with digit separators.

use std::fmt::{Display, Write as _};

/// Generated Rust source, as written so far.
#[derive(Default)]
pub(super) struct Source {
    pub(super) text: String,
}

impl Source {
    /// Appends an array of integers with the doc comment `doc`; the integers get digit separators.
    pub(super) fn array<T: Display>(&mut self, doc: &str, declaration: &str, values: &[T]) {
        let values: Vec<String> = values.iter().map(separated).collect();
        self.list(doc, declaration, &values);
    }

    /// Appends an array of already formatted values with the doc comment `doc`.
    pub(super) fn list(&mut self, doc: &str, declaration: &str, values: &[String]) {
        self.line(format_args!("/// {doc}\n{declaration} = ["));
        self.wrapped(values);
        self.line("];\n");
    }

    /// Appends comma-separated values in lines of at most 100 characters.
    pub(super) fn wrapped(&mut self, values: &[String]) {
        let mut row = String::from("   ");
        for value in values {
            if row.len() + value.len() + 2 > 100 {
                self.line(&row);
                row.truncate(3);
            }
            let _ = write!(row, " {value},");
        }
        self.line(&row);
    }

    pub(super) fn line(&mut self, line: impl Display) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{line}");
    }
}

/// Formats an integer with a digit separator after every three digits, as in `65_536`.
pub(super) fn separated(value: impl Display) -> String {
    let text = value.to_string();
    let (sign, digits) = text.strip_prefix('-').map_or(("", text.as_str()), |rest| ("-", rest));
    let mut out = String::from(sign);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push('_');
        }
        out.push(digit);
    }
    out
}

/// Formats a float literal that parses to exactly the same value, with its digits in groups of
/// three.
pub(super) fn float(value: f32) -> String {
    let text = format!("{value:?}");
    let (number, exponent) =
        text.split_once('e').map_or((text.as_str(), None), |(n, e)| (n, Some(e)));
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    let fraction: Vec<&str> = (0..fraction.len())
        .step_by(3)
        .map(|at| &fraction[at..fraction.len().min(at + 3)])
        .collect();
    let mut literal = format!("{}.{}", separated(whole), fraction.join("_"));
    if let Some(exponent) = exponent {
        let _ = write!(literal, "e{exponent}");
    }
    literal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_grouped_by_three() {
        assert_eq!(separated(1_234_567), "1_234_567");
        assert_eq!(separated(-123), "-123");
        assert_eq!(separated(-1_000), "-1_000");
    }

    #[test]
    fn a_float_literal_parses_to_the_same_bits() {
        for value in [22.351_742_f32, 1.0, 3.4e-7, 1e-7, 1_234.567_9, -0.25] {
            assert_eq!(float(value).replace('_', "").parse(), Ok(value));
        }
        assert_eq!(float(22.351_742), "22.351_742");
    }
}
