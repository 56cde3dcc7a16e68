//! Maps the signals of a recording to the electrodes of a montage.

use std::{collections::BTreeSet, fmt};

use thiserror::Error;

use crate::{
    electrode::{Electrode, names_of_another_cap},
    position::Position,
};

/// What to do with an electrode of the montage that the recording lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Missing {
    /// Interpolate the electrode from the nearest [`NEIGHBOURS`] recorded electrodes, weighted by 1
    /// / distance^2, with straight-line distances between points on the unit sphere.
    #[default]
    Interpolate,
    /// Set the electrode to 0.
    Zero,
    /// Refuse the recording: return [`MontageMapError::MissingElectrodes`].
    Refuse,
}

/// Number of recorded electrodes from which a missing electrode is interpolated. If the recording
/// has fewer electrodes, all of them are used.
pub const NEIGHBOURS: usize = 4;

/// Largest number of labels that [`MontageMapError::OtherCap`] lists.
const NAMES_SHOWN: usize = 6;

/// Where the values of one montage electrode come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Origin {
    /// Recorded: the values of the signal with this index.
    Real(usize),
    /// Interpolated: a weighted sum of signals, as pairs (signal index, weight), nearest electrode
    /// first. The weights add up to 1.
    Interpolated(Vec<(usize, f64)>),
    /// Neither recorded nor interpolated; the value is always 0.
    Zero,
}

/// Why a montage is invalid, or why a recording does not fit it.
#[derive(Debug, Error, PartialEq)]
#[expect(missing_docs, reason = "the messages say what each field means")]
pub enum MontageMapError {
    /// A label of the montage is not an electrode of the 10-5 system.
    #[error(
        "the montage contains {label}, which is not an electrode of the 10-20, 10-10 or 10-5 system"
    )]
    UnknownElectrode { label: String },
    /// Two labels of the montage denote the same electrode; `label` is the second one.
    #[error("the montage contains {label} twice")]
    DuplicateElectrode { label: String },
    /// The recording has none of the montage's electrodes.
    #[error("the recording has none of the montage's electrodes; it has {}; needed are {}", found.join(" "), needed.join(" "))]
    NoCommonElectrode { found: Vec<String>, needed: Vec<String> },
    /// The labels belong to a cap with its own names for electrodes.
    #[error(
        "the recording has names of another cap, such as {}: its C3 is not that of the 10-20 system; give the \
         signals the names of the 10-10 system (docs/recordings.md, Electrodes)",
        found.join(" ")
    )]
    OtherCap { found: Vec<String> },
    /// Electrodes of the montage are missing, and the caller chose [`Missing::Refuse`].
    #[error("the recording lacks {}; interpolate them, set them to zero, or use another recording", labels.join(" "))]
    MissingElectrodes { labels: Vec<String> },
}

/// A defect of a recording that does not prevent playing it on the montage.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages say what each field means")]
pub enum MontageWarning {
    /// The recording has fewer of the montage's electrodes than an interpolation uses.
    #[error(
        "the recording has only {} of the {needed} electrodes ({}); the codes say little about the others",
        real.len(),
        real.join(" ")
    )]
    FewElectrodes { real: Vec<String>, needed: usize },
    /// The labels of all electrodes end with the same suffix, which is not a known reference name.
    #[error("the electrodes' common ending -{reference} is taken for the name of their reference")]
    CommonReference { reference: String },
    /// All electrodes were recorded against an electrode that the montage also contains.
    #[error(
        "electrode {electrode} is the reference of all others, so it is 0 and counts as missing"
    )]
    ReferenceIsZero { electrode: String },
    /// Two signals of the recording were recorded at the same electrode.
    #[error(
        "electrode {electrode} is recorded twice: signal {used} is used, signal {ignored} is not"
    )]
    DuplicateSignal { electrode: String, used: String, ignored: String },
}

/// For each electrode of a montage, the signals of a recording from which it is computed. `Display`
/// prints which electrodes are real, interpolated or zero, and which signals are unused.
#[derive(Debug, Clone, PartialEq)]
pub struct MontageMap {
    electrodes: Vec<String>,
    origins: Vec<Origin>,
    signals: Vec<String>,
    /// The electrode that each signal's label denotes, if any.
    located: Vec<Option<Electrode>>,
    /// The common reference of all electrodes, if its name is not in `REFERENCES`.
    reference: Option<String>,
}

impl MontageMap {
    /// Finds each electrode of the montage (`electrodes`) among the labels of the recording
    /// (`labels`). [`Electrode::parse`] defines which spellings are equal. If two signals have the
    /// same electrode, the map uses the first signal. If the labels of all electrodes end with the
    /// name of one reference, this suffix is stripped; if the reference is an electrode of the
    /// montage and is not recorded, its value is 0.
    ///
    /// # Errors
    /// [`MontageMapError`] if the montage is invalid or the recording does not fit it.
    pub fn new<L: AsRef<str>, E: AsRef<str>>(
        labels: &[L],
        electrodes: &[E],
        missing: Missing,
    ) -> Result<Self, MontageMapError> {
        let owned = |label: &str| label.to_owned();
        let signals: Vec<String> = labels.iter().map(|label| owned(label.as_ref())).collect();
        let names = electrodes.iter().map(|label| owned(label.as_ref()));
        let names: Vec<String> = names.collect();
        let mut wanted = Vec::with_capacity(names.len());
        for label in &names {
            let electrode = Electrode::parse(label)
                .ok_or_else(|| MontageMapError::UnknownElectrode { label: label.clone() })?;
            if wanted.contains(&electrode) {
                return Err(MontageMapError::DuplicateElectrode { label: label.clone() });
            }
            wanted.push(electrode);
        }
        if let Some(found) = names_of_another_cap(&signals) {
            let found = found.into_iter().take(NAMES_SHOWN).map(owned).collect();
            return Err(MontageMapError::OtherCap { found });
        }
        let (located, reference) = Electrode::parse_all(&signals);
        let real = |electrode: &Electrode| {
            located.iter().position(|other| other.as_ref() == Some(electrode))
        };
        let zero = reference.as_deref().and_then(Electrode::parse);
        if wanted.iter().all(|electrode| real(electrode).is_none()) {
            return Err(MontageMapError::NoCommonElectrode { found: signals, needed: names });
        }
        let origins: Vec<Origin> = wanted
            .iter()
            .map(|electrode| match (real(electrode), missing) {
                (Some(signal), _) => Origin::Real(signal),
                (None, _) if zero == Some(*electrode) => Origin::Zero,
                (None, Missing::Interpolate) => Origin::Interpolated(nearest(electrode, &located)),
                (None, Missing::Zero | Missing::Refuse) => Origin::Zero,
            })
            .collect();
        let map = Self { electrodes: names, origins, signals, located, reference };
        if missing == Missing::Refuse && !map.zero().is_empty() {
            let labels = map.zero().into_iter().map(owned).collect();
            return Err(MontageMapError::MissingElectrodes { labels });
        }
        Ok(map)
    }

    /// Returns the labels of the montage, in montage order.
    pub fn electrodes(&self) -> &[String] {
        &self.electrodes
    }

    /// Returns where the values of each electrode come from, in montage order.
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    /// Returns the labels of those electrodes of the montage that the recording contains.
    pub fn real(&self) -> Vec<&str> {
        self.labels_with(|origin| matches!(origin, Origin::Real(_)))
    }

    /// Returns the labels of those electrodes of the montage that are interpolated from others.
    pub fn interpolated(&self) -> Vec<&str> {
        self.labels_with(|origin| matches!(origin, Origin::Interpolated(_)))
    }

    /// Returns the labels of those electrodes of the montage that are set to 0.
    pub fn zero(&self) -> Vec<&str> {
        self.labels_with(|origin| matches!(origin, Origin::Zero))
    }

    /// Returns the defects of the recording that do not prevent playing it.
    pub fn warnings(&self) -> Vec<MontageWarning> {
        let mut warnings = Vec::new();
        let real = self.real();
        if real.len() < NEIGHBOURS.min(self.electrodes.len()) {
            warnings.push(MontageWarning::FewElectrodes {
                real: real.into_iter().map(str::to_owned).collect(),
                needed: self.electrodes.len(),
            });
        }
        if let Some(reference) = self.reference.clone() {
            let electrode = Electrode::parse(&reference);
            let mut electrodes = self.electrodes.iter();
            let zero = electrodes
                .find(|label| electrode.is_some() && Electrode::parse(label) == electrode);
            warnings.push(match zero.cloned() {
                Some(electrode) => MontageWarning::ReferenceIsZero { electrode },
                None => MontageWarning::CommonReference { reference },
            });
        }
        for (second, electrode) in self.located.iter().enumerate() {
            let mut before = self.located[..second].iter();
            let first = before.position(|one| one == electrode);
            if let (Some(electrode), Some(first)) = (electrode, first) {
                warnings.push(MontageWarning::DuplicateSignal {
                    electrode: electrode.to_string(),
                    used: self.signals[first].clone(),
                    ignored: self.signals[second].clone(),
                });
            }
        }
        warnings
    }

    /// Returns the indices of the signals from which the electrodes are computed.
    pub fn used(&self) -> BTreeSet<usize> {
        let signals = self.origins.iter().flat_map(|origin| match origin {
            Origin::Real(signal) => vec![*signal],
            Origin::Interpolated(mix) => mix.iter().map(|(signal, _)| *signal).collect(),
            Origin::Zero => Vec::new(),
        });
        signals.collect()
    }

    /// Returns the labels of the recording's signals that no electrode of the montage uses.
    pub fn unused(&self) -> Vec<&str> {
        let used = self.used();
        let signals = self.signals.iter().enumerate();
        let unused = signals.filter(|(signal, _)| !used.contains(signal));
        unused.map(|(_, label)| label.as_str()).collect()
    }

    fn labels_with(&self, wanted: impl Fn(&Origin) -> bool) -> Vec<&str> {
        let pairs = self.electrodes.iter().zip(&self.origins);
        pairs.filter(|(_, origin)| wanted(origin)).map(|(label, _)| label.as_str()).collect()
    }
}

/// Returns the [`NEIGHBOURS`] signals nearest to `electrode` as pairs (index, weight). `located`
/// holds the electrode of each signal; if two signals have the same electrode, only the first is
/// used.
fn nearest(electrode: &Electrode, located: &[Option<Electrode>]) -> Vec<(usize, f64)> {
    let position = Position::from_electrode(electrode);
    let distance = |other| position.chord_squared(Position::from_electrode(other));
    let mix = located.iter().enumerate().filter_map(|(signal, other)| {
        let is_first = !located[..signal].contains(other);
        let other = other.as_ref().filter(|_| is_first)?;
        Some((signal, distance(other)))
    });
    let mut mix: Vec<(usize, f64)> = mix.collect();
    mix.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    mix.truncate(NEIGHBOURS);
    // The distance can be 0, because two electrode names can denote one position; the minimum of
    // 1e-12 keeps the weight finite.
    for (_, weight) in &mut mix {
        *weight = 1.0 / weight.max(1e-12);
    }
    let sum: f64 = mix.iter().map(|(_, weight)| weight).sum();
    for (_, weight) in &mut mix {
        *weight /= sum;
    }
    mix
}

impl fmt::Display for MontageMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut first = true;
        for (name, labels) in [
            ("real", self.real()),
            ("interpolated", self.interpolated()),
            ("zero", self.zero()),
            ("unused signals", self.unused()),
        ] {
            if labels.is_empty() {
                continue;
            }
            let separator = if std::mem::take(&mut first) { "" } else { "\n" };
            write!(f, "{separator}{name:>14}: {:2} ({})", labels.len(), labels.join(" "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_electrode_has_a_source_and_the_report_lists_it() {
        let labels = ["C3..", "Cz..", "C4..", "Fz", "Pz", "EOG", "EEG C3-REF"];
        let map = MontageMap::new(&labels, &["C1", "Cz", "C3"], Missing::Interpolate)
            .expect("two are common");
        assert_eq!(map.origins()[1], Origin::Real(1));
        assert_eq!(map.origins()[2], Origin::Real(0), "the first of two C3");
        let Origin::Interpolated(mix) = &map.origins()[0] else { panic!("C1 is missing") };
        let sources: Vec<usize> = mix.iter().map(|(signal, _)| *signal).collect();
        // C3 and Cz are both 18 degrees from C1 and so have the largest weights; Fz and Pz are
        // about 40 degrees away.
        assert_eq!(sources.len(), NEIGHBOURS);
        assert!(sources[..2].contains(&0) && sources[..2].contains(&1), "{sources:?}");
        assert!((mix.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!((mix[0].1 - mix[1].1).abs() < 1e-12 && mix[0].1 > 3.0 * mix[2].1, "{mix:?}");
        let report = map.to_string();
        for line in [
            "real:  2 (Cz C3)",
            "interpolated:  1 (C1)",
            "unused signals:  3 (C4.. EOG EEG C3-REF)",
        ] {
            assert!(report.contains(line), "{report}");
        }
    }

    #[test]
    fn a_common_reference_of_the_montage_is_zero_and_said_once() {
        let labels = ["EEG C3-CPz", "EEG C4-CPz", "EEG Pz-CPz", "ECG-CPz"];
        let electrodes = ["CPz", "C3", "Cz"];
        let map = MontageMap::new(&labels, &electrodes, Missing::Interpolate).expect("common");
        assert_eq!(map.origins()[..2], [Origin::Zero, Origin::Real(0)]);
        assert_eq!(map.interpolated(), ["Cz"]);
        let electrode = "CPz".to_owned();
        let warning = MontageWarning::ReferenceIsZero { electrode };
        assert!(map.warnings().contains(&warning));
        assert_eq!(map.used().into_iter().collect::<Vec<_>>(), [0, 1, 2]);

        let refused = MontageMap::new(&labels, &["CPz", "C3"], Missing::Refuse);
        let message = refused.expect_err("it is missing").to_string();
        assert!(message.contains("lacks CPz"), "{message}");

        let map = MontageMap::new(&["C3-G2", "C4-G2"], &["C3", "C4"], Missing::Refuse);
        let warning = map.expect("both").warnings()[0].to_string();
        assert!(warning.contains("-G2"), "{warning}");
    }

    #[test]
    fn the_names_of_another_cap_are_refused() {
        let cap = |letters: &str, form: fn(char, u8) -> String| {
            let letters = letters.chars();
            let labels = letters.flat_map(|letter| (1..=32).map(move |n| form(letter, n)));
            labels.collect::<Vec<String>>()
        };
        let plain = |letter, n| format!("{letter}{n}");
        for labels in [
            cap("AB", plain),
            cap("ABCD", plain),
            cap("CDEFGH", plain),
            cap("AB", |letter, n| format!("EEG {letter}{n}-REF")),
        ] {
            let refused = MontageMap::new(&labels, &["C3", "F4"], Missing::Interpolate);
            let message = refused.expect_err("another cap").to_string();
            assert!(message.contains("names of another cap"), "{message}");
        }
        // Seven labels such as B7, beside ear lobes and 10-20 electrodes, are too few to count as
        // another cap.
        let mut labels = cap("B", plain)[..7].to_vec();
        labels.extend(["A1", "A2", "C3", "F4"].map(str::to_owned));
        let map = MontageMap::new(&labels, &["C3", "F4"], Missing::Refuse);
        assert_eq!(map.expect("both").real(), ["C3", "F4"]);
    }

    #[test]
    fn errors_name_the_electrodes_that_do_not_fit() {
        let refused = MontageMap::new(&["Cz"], &["C1", "Cz", "C2"], Missing::Refuse);
        let labels = vec!["C1".to_owned(), "C2".to_owned()];
        assert_eq!(refused, Err(MontageMapError::MissingElectrodes { labels }));

        let foreign = MontageMap::new(&["ECG", "A16"], &["Cz", "Pz"], Missing::Interpolate);
        let message = foreign.expect_err("nothing in common").to_string();
        assert!(message.contains("it has ECG A16; needed are Cz Pz"), "{message}");

        let twice = MontageMap::new(&["Cz"], &["FFC1", "FFC1h"], Missing::Zero);
        let label = "FFC1h".to_owned();
        assert_eq!(twice, Err(MontageMapError::DuplicateElectrode { label }));
        let unknown = MontageMap::new(&["Cz"], &["Cz", "Q1"], Missing::Zero);
        let label = "Q1".to_owned();
        assert_eq!(unknown, Err(MontageMapError::UnknownElectrode { label }));
    }
}
