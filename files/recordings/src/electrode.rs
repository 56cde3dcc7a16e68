//! Electrodes of the 10-5 system, and a parser for the label spellings that occur in files.

use std::fmt;

/// A row of the 10-5 system: electrodes from the left to the right side of the head.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Row {
    /// Name of the row in labels of columns z and 1 to 6, near the midline, such as `C`.
    inner: &'static str,
    /// Name of the row in labels of columns 7 to 10, at the head's circumference, such as `T`.
    outer: &'static str,
    /// Distance from the nasion, in twentieths of the midline from nasion to inion, 0..=20.
    pub(crate) twentieths: u8,
    /// True if a column number in this row always means a half column, with or without `h`.
    /// Montages write FFC1 for FFC1h, and no common cap has full columns in such rows.
    always_half: bool,
}

const fn row(inner: &'static str, outer: &'static str, twentieths: u8, always_half: bool) -> Row {
    Row { inner, outer, twentieths, always_half }
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

/// Suffixes after a dash that always name a common reference. Any other suffix is a common
/// reference only if all electrodes of a recording have it. Otherwise it names a second electrode,
/// and the signal, a difference of two electrodes, has no single position.
const REFERENCES: [&str; 13] =
    ["REF", "LE", "RE", "AR", "AV", "AVG", "CAR", "A1", "A2", "A1A2", "M1", "M2", "M1M2"];

/// Number of labels such as B7 (a letter and a number) from which a recording counts as made with
/// a cap that has names of its own.
const CAP_NAMES_MIN: usize = 8;

/// Returns the name in a label, and the reference that follows a dash. Both are in upper case,
/// without dots, blanks, underscores and prefixes.
fn spelling(label: &str) -> (String, Option<String>) {
    let plain = label.to_ascii_uppercase().replace(['.', ' ', '_'], "");
    let mut prefixes = ["EEG", "POL"].iter();
    let rest = prefixes.find_map(|prefix| plain.strip_prefix(prefix));
    let rest = rest.unwrap_or(&plain).trim_start_matches([':', '-']);
    match rest.split_once('-') {
        Some((name, reference)) => (name.to_owned(), Some(reference.to_owned())),
        None => (rest.to_owned(), None),
    }
}

/// Returns the labels that name electrodes by a letter and a number, as BioSemi's caps (A1 to H32)
/// and depth electrodes do; `None` if there are fewer than [`CAP_NAMES_MIN`].
///
/// Also `None` if none of these labels begins with C or F, and another label, such as Cz, certainly
/// names an electrode of the 10-20 system: the labels then name auxiliary signals.
///
/// Labels that the 10-20 system also has, such as C3, F3 and the ear lobes A1 and A2, are not
/// returned, although they name other electrodes in such a cap.
pub(crate) fn names_of_another_cap<L: AsRef<str>>(labels: &[L]) -> Option<Vec<&str>> {
    let is_foreign = |label: &&str| {
        let (name, _) = spelling(label);
        let number = name.get(1..).and_then(|number| number.parse::<u8>().ok());
        let is_cap = name.starts_with(|letter| matches!(letter, 'A'..='H'))
            && number.is_some_and(|number| (1..=32).contains(&number));
        is_cap && !matches!(&*name, "A1" | "A2") && Electrode::named(&name).is_none()
    };
    let found: Vec<&str> = labels.iter().map(AsRef::as_ref).filter(is_foreign).collect();
    // C8, which the 10-20 system lacks, shows that C3 is a name of the cap too. Cz beside E1 to E8
    // shows that E1 to E8 are auxiliary signals.
    let clashes = |label: &&str| spelling(label).0.starts_with(['C', 'F']);
    let is_certain = |label: &L| {
        let (name, _) = spelling(label.as_ref());
        let is_ambiguous = name.get(1..).is_some_and(|rest| rest.parse::<u8>().is_ok());
        !is_ambiguous && Electrode::named(&name).is_some()
    };
    let is_other = found.iter().any(clashes) || !labels.iter().any(is_certain);
    (found.len() >= CAP_NAMES_MIN && is_other).then_some(found)
}

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
    /// Ignores letter case, dots, blanks and underscores. Strips the prefixes `EEG`, `EEG:`, `EEG-`
    /// and `POL`, and the suffix of a common reference (`-REF`, `-LE`, ...). Renames T3 T4 T5 T6 to
    /// T7 T8 P7 P8. In the rows FFC/FFT, FCC/FTT, CCP/TTP, CPP/TPP and PPO a trailing `h` is
    /// implied.
    pub fn parse(label: &str) -> Option<Self> {
        match spelling(label) {
            (_, Some(reference)) if !REFERENCES.contains(&&*reference) => None,
            (name, _) => Self::named(&name),
        }
    }

    /// Returns the electrodes that `labels` denote, as [`Self::parse`] does, and, in upper case,
    /// their common reference if [`REFERENCES`] lacks it. Such a suffix counts as a reference only
    /// if all electrodes, at least two different ones, have it; the signals of a bipolar montage
    /// share no suffix.
    pub(crate) fn parse_all<L: AsRef<str>>(labels: &[L]) -> (Vec<Option<Self>>, Option<String>) {
        let spellings = labels.iter().map(|label| spelling(label.as_ref()));
        let named: Vec<_> =
            spellings.map(|(name, reference)| (Self::named(&name), reference)).collect();
        let mut electrodes = named.iter().filter(|(electrode, _)| electrode.is_some());
        if let Some((first, Some(shared))) = electrodes.next()
            && !REFERENCES.contains(&shared.as_str())
            && electrodes.clone().any(|(other, _)| other != first)
            && electrodes.all(|(_, reference)| reference.as_ref() == Some(shared))
        {
            let shared = Some(shared.clone());
            return (named.into_iter().map(|(electrode, _)| electrode).collect(), shared);
        }
        let parsed = labels.iter().map(|label| Self::parse(label.as_ref()));
        (parsed.collect(), None)
    }

    /// Returns the electrode with this name, in the spelling that [`spelling`] returns.
    fn named(plain: &str) -> Option<Self> {
        let plain = OLD_NAMES.iter().find(|(old, _)| *old == plain).map_or(plain, |(_, new)| new);
        let (plain, half) = match plain.strip_suffix('H') {
            Some(rest) => (rest, true),
            None => (plain, false),
        };
        let letters = plain.trim_end_matches(|c: char| c.is_ascii_digit());
        if letters.len() == plain.len() {
            let row = row_named(plain.strip_suffix('Z')?, false)?;
            return (!half).then_some(Self { row, column: 0, half });
        }
        let column: u8 = plain[letters.len()..].parse().ok()?;
        if !(1..=10).contains(&column) {
            return None;
        }
        let row = row_named(letters, column >= 7)?;
        let electrode = Self { row, column, half: half || row.always_half };
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
        let name = if self.column >= 7 { self.row.outer } else { self.row.inner };
        match self.column {
            0 => write!(f, "{name}z"),
            column => write!(f, "{name}{column}{}", if self.half { "h" } else { "" }),
        }
    }
}

fn row_named(upper: &str, outer: bool) -> Option<Row> {
    let name = |row: &Row| if outer { row.outer } else { row.inner };
    ROWS.iter().find(|row| name(row).eq_ignore_ascii_case(upper)).copied()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::position::Position;

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
            ("EEG-C3", "C3"),
            ("EEG_C3", "C3"),
            ("EEG-Fp1-LE", "Fp1"),
            ("POL Fp1", "Fp1"),
        ] {
            assert_eq!(canonical(label).as_deref(), Some(name), "{label}");
        }
        assert_ne!(Electrode::parse("C1h"), Electrode::parse("C1"));
    }

    proptest! {
        #[test]
        fn every_label_is_an_electrode_on_the_sphere_or_none(
            anything in "\\PC{0,20}",
            similar in "(EEG[-:_ ]|POL )?[a-zA-Z]{1,4}[0-9]{0,3}[hH.]{0,2}(-REF)?",
        ) {
            for label in [anything, similar] {
                if let Some(electrode) = Electrode::parse(&label) {
                    let Position { x, y, z } = Position::from_electrode(&electrode);
                    let radius = (x * x + y * y + z * z).sqrt();
                    prop_assert!((radius - 1.0).abs() < 1e-12, "{label}: {radius}");
                    prop_assert_eq!(Electrode::parse(&electrode.to_string()), Some(electrode));
                }
            }
        }
    }

    #[test]
    fn a_letter_and_a_number_name_another_cap_unless_certain_names_show_that_they_do_not() {
        let with = |letter: char, others: &str| {
            let own = (1..=8).map(|number| format!("{letter}{number}"));
            let labels: Vec<String> = own.chain(others.split(' ').map(str::to_owned)).collect();
            super::names_of_another_cap(&labels).is_some()
        };
        assert!(with('E', "C3 F4"));
        assert!(!with('E', "C3 F4 Cz"));
        assert!(with('C', "C11 C12 C13 C14 C15 C16 C17 C18 Cz"));
    }

    #[test]
    fn a_suffix_that_all_electrodes_share_is_their_reference() {
        let parsed = |labels: &[&str]| {
            let (electrodes, reference) = Electrode::parse_all(labels);
            let names = electrodes.iter().flatten().map(ToString::to_string);
            (names.collect::<Vec<_>>().join(" "), reference)
        };
        for suffix in ["Pz", "CPz", "A1+A2", "LER", "VREF", "AA", "G2"] {
            let labels = ["EEG Fp1", "T3", "ECG", "EEG-O2"].map(|name| format!("{name}-{suffix}"));
            let labels: Vec<&str> = labels.iter().map(String::as_str).collect();
            let expected = ("Fp1 T7 O2".to_owned(), Some(suffix.to_ascii_uppercase()));
            assert_eq!(parsed(&labels), expected);
        }
        // Bipolar montages, and files in which only some signals have the suffix.
        for (labels, names) in [
            ("Fp1-F7,F7-T3,T3-T5", ""),
            ("C3-Pz,EEG C3-Pz,ECG-Pz", ""),
            ("C3-Pz,C4-Pz,Oz", "Oz"),
            ("C3-A2,C4-A1,ROC-A1,Fz-Pz", "C3 C4"),
            ("C3-REF,C4-REF", "C3 C4"),
        ] {
            let labels: Vec<&str> = labels.split(',').collect();
            assert_eq!(parsed(&labels), (names.to_owned(), None), "{labels:?}");
        }
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
