//! Physical units of signals. Only voltages are interpreted.

use std::fmt;

/// Unit of a signal: its text in the file and, for a supported voltage, its size in uV.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    text: String,
    microvolts: Option<f64>,
}

/// GDF 2 physical dimension code of the volt. The lowest five bits hold the decimal prefix (GDF 2
/// specification, table of physical dimensions, after ISO/IEEE 11073-10101).
const GDF_VOLT: u16 = 4256;

impl Unit {
    /// Interprets the unit text of a header: `uV`, `mV`, `V` or `nV`, with the micro sign in any
    /// encoding.
    pub fn from_text(text: &str) -> Self {
        let text = text.trim();
        let microvolts = match text.replace(['µ', 'μ'], "u").as_str() {
            "nV" | "nv" => Some(1e-3),
            "uV" | "uv" | "UV" => Some(1.0),
            "mV" | "mv" => Some(1e3),
            "V" | "v" => Some(1e6),
            _ => None,
        };
        Self {
            text: text.to_owned(),
            microvolts,
        }
    }

    /// Interprets a GDF 2 physical dimension code: 4256 V, 4274 mV, 4275 uV, 4276 nV. For code 0 the
    /// header has only the text.
    pub fn from_gdf_code(code: u16, text: &str) -> Self {
        if code == 0 {
            return Self::from_text(text);
        }
        let (name, microvolts) = match code.checked_sub(GDF_VOLT) {
            Some(0) => ("V", Some(1e6)),
            Some(18) => ("mV", Some(1e3)),
            Some(19) => ("uV", Some(1.0)),
            Some(20) => ("nV", Some(1e-3)),
            _ => (text.trim(), None),
        };
        let text = if name.is_empty() {
            format!("code {code}")
        } else {
            name.to_owned()
        };
        Self { text, microvolts }
    }

    /// Returns the size of the unit, uV; `None` unless the unit is a supported voltage.
    pub fn microvolts(&self) -> Option<f64> {
        self.microvolts
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.text.is_empty() {
            "(none)"
        } else {
            &self.text
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voltages_are_recognised_by_text_and_by_code() {
        for (text, microvolts) in [
            ("uV", 1.0),
            (" µV ", 1.0),
            ("μV", 1.0),
            ("mV", 1e3),
            ("V", 1e6),
            ("nV", 1e-3),
        ] {
            assert_eq!(
                Unit::from_text(text).microvolts(),
                Some(microvolts),
                "{text}"
            );
        }
        for (code, microvolts) in [(4256, 1e6), (4274, 1e3), (4275, 1.0), (4276, 1e-3)] {
            assert_eq!(
                Unit::from_gdf_code(code, "").microvolts(),
                Some(microvolts),
                "{code}"
            );
        }
        assert_eq!(Unit::from_gdf_code(0, "mV").microvolts(), Some(1e3));
    }

    #[test]
    fn other_units_are_not_guessed() {
        for text in ["", "Boolean", "MV", "degC"] {
            assert_eq!(Unit::from_text(text).microvolts(), None, "{text}");
        }
        assert_eq!(Unit::from_gdf_code(512, "").to_string(), "code 512");
    }
}
