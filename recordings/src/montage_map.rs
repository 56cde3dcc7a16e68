//! The map from a recording's signals to the electrodes of a montage.

use std::fmt;

use thiserror::Error;

use crate::{Electrode, Position};

/// What to do with an electrode that the recording lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Missing {
    /// Mix the four nearest electrodes that it has, weighted by 1 / distance^2 (straight
    /// distance through the unit sphere).
    #[default]
    Interpolate,
    /// Leave it at 0.
    Zero,
    /// Refuse the recording.
    Refuse,
}

/// How many real electrodes an interpolated one is mixed from.
pub const NEIGHBOURS: usize = 4;

/// Where an electrode's values come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Origin {
    /// The signal with this index.
    Real(usize),
    /// Signals and their weights, which add up to 1; the nearest first.
    Interpolated(Vec<(usize, f64)>),
    /// Nowhere: 0 throughout.
    Zero,
}

/// Why a recording does not fit a montage.
#[derive(Debug, Error, PartialEq)]
pub enum MontageMapError {
    /// A label of the montage is not in the 10-5 system.
    #[error(
        "the montage asks for {label:?}, which is no electrode of the 10-20, 10-10 or 10-5 system"
    )]
    UnknownElectrode {
        /// The label.
        label: String,
    },
    /// Two labels of the montage are one electrode.
    #[error("the montage asks for {label:?} twice")]
    Twice {
        /// The second label.
        label: String,
    },
    /// The recording has none of the montage's electrodes.
    #[error("the recording has none of the montage's electrodes; it has {}; needed are {}", found.join(" "), needed.join(" "))]
    NothingInCommon {
        /// The recording's labels.
        found: Vec<String>,
        /// The montage's labels.
        needed: Vec<String>,
    },
    /// Electrodes are missing and [`Missing::Refuse`] was asked for.
    #[error("the recording lacks {}; let them be interpolated or zero, or use another recording", labels.join(" "))]
    MissingElectrodes {
        /// Labels of the missing electrodes.
        labels: Vec<String>,
    },
}

/// The map from a recording's signals to a montage's electrodes; `Display` gives a report.
#[derive(Debug, Clone, PartialEq)]
pub struct MontageMap {
    electrodes: Vec<String>,
    origins: Vec<Origin>,
    signals: Vec<String>,
}

impl MontageMap {
    /// Finds each of `electrodes` among the `labels` of a recording ([`Electrode::parse`] says
    /// which spellings are one). When two signals carry one electrode, the first is taken.
    ///
    /// # Errors
    /// [`MontageMapError`], one variant for each way in which the two do not fit.
    pub fn new<L: AsRef<str>, E: AsRef<str>>(
        labels: &[L],
        electrodes: &[E],
        missing: Missing,
    ) -> Result<Self, MontageMapError> {
        let owned = |label: &str| label.to_owned();
        let signals: Vec<String> = labels.iter().map(|label| owned(label.as_ref())).collect();
        let names: Vec<String> = electrodes
            .iter()
            .map(|label| owned(label.as_ref()))
            .collect();
        let mut wanted = Vec::with_capacity(names.len());
        for label in &names {
            let electrode =
                Electrode::parse(label).ok_or_else(|| MontageMapError::UnknownElectrode {
                    label: label.clone(),
                })?;
            if wanted.contains(&electrode) {
                return Err(MontageMapError::Twice {
                    label: label.clone(),
                });
            }
            wanted.push(electrode);
        }
        let mut located: Vec<(usize, Electrode)> = Vec::new();
        for (signal, label) in signals.iter().enumerate() {
            if let Some(electrode) = Electrode::parse(label)
                && located.iter().all(|(_, other)| *other != electrode)
            {
                located.push((signal, electrode));
            }
        }
        let real = |electrode: &Electrode| {
            located
                .iter()
                .find(|(_, other)| other == electrode)
                .map(|(signal, _)| *signal)
        };
        if wanted.iter().all(|electrode| real(electrode).is_none()) {
            return Err(MontageMapError::NothingInCommon {
                found: signals,
                needed: names,
            });
        }
        let origins: Vec<Origin> = wanted
            .iter()
            .map(|electrode| match (real(electrode), missing) {
                (Some(signal), _) => Origin::Real(signal),
                (None, Missing::Interpolate) => Origin::Interpolated(nearest(electrode, &located)),
                (None, Missing::Zero | Missing::Refuse) => Origin::Zero,
            })
            .collect();
        let map = Self {
            electrodes: names,
            origins,
            signals,
        };
        if missing == Missing::Refuse && !map.zero().is_empty() {
            let labels = map.zero().into_iter().map(owned).collect();
            return Err(MontageMapError::MissingElectrodes { labels });
        }
        Ok(map)
    }

    /// The montage's labels, in its order.
    pub fn electrodes(&self) -> &[String] {
        &self.electrodes
    }

    /// Where each electrode comes from, in the montage's order.
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    /// Labels of the electrodes that the recording has.
    pub fn real(&self) -> Vec<&str> {
        self.labels_with(|origin| matches!(origin, Origin::Real(_)))
    }

    /// Labels of the electrodes that are mixed from others.
    pub fn interpolated(&self) -> Vec<&str> {
        self.labels_with(|origin| matches!(origin, Origin::Interpolated(_)))
    }

    /// Labels of the electrodes that stay at 0.
    pub fn zero(&self) -> Vec<&str> {
        self.labels_with(|origin| matches!(origin, Origin::Zero))
    }

    /// Labels of the signals that no electrode takes anything from.
    pub fn unused(&self) -> Vec<&str> {
        let unused = |(signal, _): &(usize, _)| {
            self.origins.iter().all(|origin| match origin {
                Origin::Real(own) => own != signal,
                Origin::Interpolated(mix) => mix.iter().all(|(own, _)| own != signal),
                Origin::Zero => true,
            })
        };
        self.signals
            .iter()
            .enumerate()
            .filter(unused)
            .map(|(_, label)| label.as_str())
            .collect()
    }

    fn labels_with(&self, wanted: impl Fn(&Origin) -> bool) -> Vec<&str> {
        let pairs = self.electrodes.iter().zip(&self.origins);
        pairs
            .filter(|(_, origin)| wanted(origin))
            .map(|(label, _)| label.as_str())
            .collect()
    }
}

/// The [`NEIGHBOURS`] nearest of the located signals with their weights.
fn nearest(electrode: &Electrode, located: &[(usize, Electrode)]) -> Vec<(usize, f64)> {
    let place = Position::of(electrode);
    let mut mix: Vec<(usize, f64)> = located
        .iter()
        .map(|(signal, other)| (*signal, place.chord_squared(Position::of(other))))
        .collect();
    mix.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    mix.truncate(NEIGHBOURS);
    // T9h and such may share a place with another name; 1e-12 keeps the weight finite.
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
            write!(
                f,
                "{separator}{name:>14}: {:2} ({})",
                labels.len(),
                labels.join(" ")
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_electrode_gets_its_origin_and_the_report_tells() {
        let labels = ["C3..", "Cz..", "C4..", "Fz", "Pz", "EOG", "EEG C3-REF"];
        let map = MontageMap::new(&labels, &["C1", "Cz", "C3"], Missing::Interpolate)
            .expect("two are common");
        assert_eq!(map.origins()[1], Origin::Real(1));
        assert_eq!(map.origins()[2], Origin::Real(0), "the first of two C3");
        let Origin::Interpolated(mix) = &map.origins()[0] else {
            panic!("C1 is missing")
        };
        let sources: Vec<usize> = mix.iter().map(|(signal, _)| *signal).collect();
        // C1 lies 18 degrees from C3 and Cz, about 40 from Fz and Pz.
        assert_eq!(sources.len(), NEIGHBOURS);
        assert!(
            sources[..2].contains(&0) && sources[..2].contains(&1),
            "{sources:?}"
        );
        assert!((mix.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(
            (mix[0].1 - mix[1].1).abs() < 1e-12 && mix[0].1 > 3.0 * mix[2].1,
            "{mix:?}"
        );
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
    fn zero_leaves_the_missing_empty() {
        let map = MontageMap::new(&["Cz"], &["C1", "Cz"], Missing::Zero).expect("Cz is common");
        assert_eq!(map.origins(), [Origin::Zero, Origin::Real(0)]);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let refused = MontageMap::new(&["Cz"], &["C1", "Cz", "C2"], Missing::Refuse);
        let labels = vec!["C1".to_owned(), "C2".to_owned()];
        assert_eq!(refused, Err(MontageMapError::MissingElectrodes { labels }));

        let foreign = MontageMap::new(&["ECG", "A16"], &["Cz", "Pz"], Missing::Interpolate);
        let message = foreign.expect_err("nothing in common").to_string();
        assert!(
            message.contains("it has ECG A16; needed are Cz Pz"),
            "{message}"
        );

        let twice = MontageMap::new(&["Cz"], &["FFC1", "FFC1h"], Missing::Zero);
        assert_eq!(
            twice,
            Err(MontageMapError::Twice {
                label: "FFC1h".to_owned()
            })
        );
        let unknown = MontageMap::new(&["Cz"], &["Cz", "Q1"], Missing::Zero);
        assert_eq!(
            unknown,
            Err(MontageMapError::UnknownElectrode {
                label: "Q1".to_owned()
            })
        );
    }
}
