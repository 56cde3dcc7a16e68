//! Bad electrodes that the device excludes from its codes: what the user wants, and what the device
//! reports.

use link::{Exclusion, ExclusionPolicy};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::device::Device;

/// The user's choice of electrodes to exclude. The device computes their signals from the others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exclusions {
    /// Labels of electrodes that are always excluded.
    pub always: Vec<String>,
    /// Labels of electrodes that are never excluded.
    pub never: Vec<String>,
    /// Whether the device excludes electrodes that it finds bad.
    pub automatic: bool,
}

impl Default for Exclusions {
    /// Leaves the choice to the device, which excludes the electrodes that it finds bad.
    fn default() -> Exclusions {
        Exclusions { always: Vec::new(), never: Vec::new(), automatic: true }
    }
}

impl Exclusions {
    /// Returns the policy for a device with the electrodes `labels`, and the wanted labels that the
    /// device does not have. Upper and lower case do not matter.
    pub(crate) fn policy(&self, labels: &[String]) -> (ExclusionPolicy, Vec<String>) {
        let mut unknown = Vec::new();
        let mut mask = |wanted: &[String]| {
            wanted.iter().fold(0, |mask, label| {
                let place =
                    labels.iter().take(64).position(|known| known.eq_ignore_ascii_case(label));
                if place.is_none() {
                    unknown.push(label.clone());
                }
                mask | place.map_or(0, |place| 1 << place)
            })
        };
        let policy = ExclusionPolicy {
            always: mask(&self.always),
            never: mask(&self.never),
            automatic: self.automatic,
        };
        (policy, unknown)
    }
}

/// Returns the status `exclusion`: a warning if an electrode is excluded, or should be and is not.
pub(crate) fn status(report: &Exclusion, device: &Device) -> DiagnosticStatus {
    let named = |mask: u64| match labels(mask, &device.labels).join(" ") {
        none if none.is_empty() => "none".to_owned(),
        labels => labels,
    };
    let ExclusionPolicy { always, never, automatic } = report.policy;
    let state = if always & !report.excluded != 0 {
        let message = format!(
            "filled from the others: {}; not yet, or because there is no room: {}",
            named(report.excluded),
            named(always & !report.excluded)
        );
        (DiagnosticLevel::Warn, message)
    } else if report.excluded != 0 {
        let message = format!("filled from the others: {}", named(report.excluded));
        (DiagnosticLevel::Warn, message)
    } else {
        let message = "no electrode is excluded".to_owned();
        (DiagnosticLevel::Ok, message)
    };
    let values = vec![
        KeyValue::new("excluded", &named(report.excluded)),
        KeyValue::new("always excluded", &named(always)),
        KeyValue::new("never excluded", &named(never)),
        KeyValue::new("found by the device", &if automatic { "yes" } else { "no" }),
    ];
    DiagnosticStatus::new("exclusion", state, values)
}

/// Returns the labels of the electrodes in a mask, or "electrode 5" for index 5 without a label.
pub(crate) fn labels(mask: u64, labels: &[String]) -> Vec<String> {
    let electrodes = (0..64).filter(|electrode| mask >> electrode & 1 != 0);
    let label = |electrode: usize| {
        let label = labels.get(electrode).cloned();
        label.unwrap_or_else(|| format!("electrode {electrode}"))
    };
    electrodes.map(label).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_become_masks_and_unknown_ones_are_named() {
        let device = ["Fp1", "Fp2", "Cz"].map(str::to_owned);
        let wanted = Exclusions {
            always: vec!["cz".to_owned(), "Xy".to_owned()],
            never: vec!["FP1".to_owned()],
            automatic: false,
        };
        let (policy, unknown) = wanted.policy(&device);
        assert_eq!((policy.always, policy.never, policy.automatic), (4, 1, false));
        assert_eq!(unknown, ["Xy"]);
        assert_eq!(labels(policy.always | 1 << 5, &device), ["Cz", "electrode 5"]);
    }
}
