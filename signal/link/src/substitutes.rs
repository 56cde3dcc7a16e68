//! Electrodes whose signal was not recorded.

use serde::{Deserialize, Serialize};

/// Electrodes whose samples are a substitute, because the recording that the device plays lacks
/// them; sent between `Hello` and `Capabilities`, and not by a device that measures all electrodes.
///
/// In both bit sets, bit n is electrode n of
/// [`Capabilities::labels`](crate::Capabilities::labels).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Substitutes {
    /// Electrodes interpolated from other electrodes.
    pub interpolated: u64,
    /// Electrodes without a signal: every sample is 0.
    pub zero: u64,
}

impl Substitutes {
    /// Every electrode is measured.
    pub const NONE: Self = Self {
        interpolated: 0,
        zero: 0,
    };
    /// Formats the electrodes of both sets by their labels, such as "interpolated: F1 F2; zero: Cz".
    /// `labels` are those of [`Capabilities::labels`](crate::Capabilities::labels).
    pub fn named<'a>(
        self,
        labels: impl Iterator<Item = &'a str> + Clone,
    ) -> impl core::fmt::Display {
        core::fmt::from_fn(move |f| {
            let mut separator = "";
            for (kind, set) in [("interpolated", self.interpolated), ("zero", self.zero)] {
                let mut start = kind;
                for (_, label) in labels
                    .clone()
                    .enumerate()
                    .filter(|(n, _)| *n < 64 && set >> n & 1 == 1)
                {
                    if start == kind {
                        write!(f, "{separator}{kind}:")?;
                    }
                    (start, separator) = ("", "; ");
                    write!(f, " {label}")?;
                }
            }
            Ok(())
        })
    }
}
