//! Electrodes of the 10-5 system, and a parser for the ways in which files spell their labels.

use std::fmt;

/// A row of the 10-5 system: electrodes from the left side of the head to the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Row {
    /// Name of the row in labels of columns z and 1 to 6, near the midline, such as `C`.
    inner: &'static str,
    /// Name of the row in labels of columns 7 to 10, at the head's circumference, such as `T`.
    outer: &'static str,
    /// Distance of the row from the nasion, in twentieths of the midline from nasion to inion,
    /// 0..=20.
    pub(crate) twentieths: u8,
    /// True if every label of the row with a column number means a half column, with or without
    /// `h`: montages write FFC1 for FFC1h, and no common cap has full columns in such rows.
    always_half: bool,
}

const fn row(inner: &'static str, outer: &'static str, twentieths: u8, always_half: bool) -> Row {
    Row {
        inner,
        outer,
        twentieths,
        always_half,
    }
}

/// All rows from nasion to inion, after Oostenveld and Praamstra 2001, figure 2.
const ROWS: [Row; 21] = [
    row("N", "N", 0, false),
    row("NFp", "NFp", 1, false),
    row("Fp", "Fp", 2, false),
    row("AFp", "AFp", 3, false),
    row("AF", "AF", 4, false),
    row("AFF", "AFF", 5, false),
    row("F", "F", 6, false),
    row("FFC", "FFT", 7, true),
    row("FC", "FT", 8, false),
    row("FCC", "FTT", 9, true),
    row("C", "T", 10, false),
    row("CCP", "TTP", 11, true),
    row("CP", "TP", 12, false),
    row("CPP", "TPP", 13, true),
    row("P", "P", 14, false),
    row("PPO", "PPO", 15, true),
    row("PO", "PO", 16, false),
    row("POO", "POO", 17, false),
    row("O", "O", 18, false),
    row("OI", "OI", 19, false),
    row("I", "I", 20, false),
];

/// Old and new names of the four electrodes of the 10-20 system that were renamed.
const OLD_NAMES: [(&str, &str); 4] = [("T3", "T7"), ("T4", "T8"), ("T5", "P7"), ("T6", "P8")];

/// Suffixes after a dash that name a common reference. Any other suffix names a second electrode:
/// such a signal is the difference of two electrodes and has no single position.
const REFERENCES: [&str; 13] = [
    "REF", "LE", "RE", "AR", "AV", "AVG", "CAR", "A1", "A2", "A1A2", "M1", "M2", "M1M2",
];

/// An electrode of the 10-20, 10-10 or 10-5 system. Different spellings of one electrode are equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Electrode {
    pub(crate) row: Row,
    /// Column number, at most 10: 0 on the midline, odd on the left, even on the right.
    pub(crate) column: u8,
    /// True if the label ends with `h`, which means half a column closer to the midline.
    pub(crate) half: bool,
}

impl Electrode {
    /// Returns the electrode that `label` denotes; `None` for any other label, such as EOG, a
    /// trigger, a bipolar derivation or a cap with a different numbering.
    ///
    /// Ignores letter case, dots, blanks and underscores. Strips the prefixes `EEG` and `eeg:` and
    /// the suffix of a common reference (`-REF`, `-LE`, ...). Renames T3 T4 T5 T6 to T7 T8 P7 P8.
    /// In the rows FFC/FFT, FCC/FTT, CCP/TTP, CPP/TPP and PPO a trailing `h` is implied.
    pub fn parse(label: &str) -> Option<Self> {
        let plain: String = label
            .to_ascii_uppercase()
            .chars()
            .filter(|c| !matches!(c, '.' | ' ' | '_'))
            .collect();
        let plain = plain
            .strip_prefix("EEG")
            .unwrap_or(&plain)
            .trim_start_matches(':');
        let plain = match plain.split_once('-') {
            Some((name, reference)) if REFERENCES.contains(&reference) => name,
            Some(_) => return None,
            None => plain,
        };
        let plain = OLD_NAMES
            .iter()
            .find(|(old, _)| *old == plain)
            .map_or(plain, |(_, new)| new);
        let (plain, half) = match plain.strip_suffix('H') {
            Some(rest) => (rest, true),
            None => (plain, false),
        };
        let letters = plain.trim_end_matches(|c: char| c.is_ascii_digit());
        if letters.len() == plain.len() {
            let row = row_named(plain.strip_suffix('Z')?, false)?;
            return (!half).then_some(Self {
                row,
                column: 0,
                half,
            });
        }
        let column: u8 = plain[letters.len()..].parse().ok()?;
        if !(1..=10).contains(&column) {
            return None;
        }
        let row = row_named(letters, column >= 7)?;
        let electrode = Self {
            row,
            column,
            half: half || row.always_half,
        };
        electrode.exists().then_some(electrode)
    }

    /// Returns the distance from the midline along the row, where 8 is the circumference: 1 for
    /// column 1h, 2 for column 1, 8 for column 7. Columns 9h (9) and 9 (10) are below the
    /// circumference.
    pub(crate) fn eighths(self) -> u8 {
        2 * self.column.div_ceil(2) - u8::from(self.half)
    }

    /// Returns whether the 10-5 system has this column in this row. The rows N, NFp, Fp, O, OI and
    /// I have only the midline and columns 1 and 2 with their halves, but Fp and O also have
    /// columns 9 and 10. All other rows have every column.
    fn exists(self) -> bool {
        match self.row.twentieths {
            0 | 1 | 19 | 20 => self.column <= 2,
            2 | 18 => self.column <= 2 || self.column >= 9,
            _ => true,
        }
    }
}

impl fmt::Display for Electrode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = if self.column >= 7 {
            self.row.outer
        } else {
            self.row.inner
        };
        match self.column {
            0 => write!(f, "{name}z"),
            column => write!(f, "{name}{column}{}", if self.half { "h" } else { "" }),
        }
    }
}

fn row_named(upper: &str, outer: bool) -> Option<Row> {
    let name = |row: &Row| if outer { row.outer } else { row.inner };
    ROWS.iter()
        .find(|row| name(row).eq_ignore_ascii_case(upper))
        .copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn canonical(label: &str) -> Option<String> {
        Electrode::parse(label).map(|electrode| electrode.to_string())
    }

    #[test]
    fn all_spellings_of_an_electrode_are_equal() {
        for (label, name) in [
            ("Fcz.", "FCz"),
            ("C3..", "C3"),
            ("EEG Fp1", "Fp1"),
            ("EEG FP1-REF", "Fp1"),
            ("eeg:C4", "C4"),
            ("C3-LE", "C3"),
            ("T3", "T7"),
            ("EEG T6-A1", "P8"),
            ("afz", "AFz"),
            (" Iz ", "Iz"),
            ("FFC1", "FFC1h"),
            ("ffc1H", "FFC1h"),
            ("FTT7", "FTT7h"),
            ("TTP8h", "TTP8h"),
            ("PPO2", "PPO2h"),
            ("T10.", "T10"),
            ("C1h", "C1h"),
        ] {
            assert_eq!(canonical(label).as_deref(), Some(name), "{label}");
        }
        assert_ne!(Electrode::parse("C1h"), Electrode::parse("C1"));
    }

    #[test]
    fn other_labels_are_not_electrodes() {
        for label in [
            "", "A1", "A16", "Status", "eog:L", "ECG", "C3-P3", "C7", "FC7", "T1", "F11", "C0",
            "Czh", "z", "7", "Fp3", "I5", "EEG", "-", "h", "µ", "Fpzz",
        ] {
            assert_eq!(canonical(label), None, "{label}");
        }
        assert_eq!(canonical("EDF Annotations"), None);
    }
}
