//! Impedance of the simulated electrodes.

use std::str::FromStr;

use pipeline::ELECTRODES;
use thiserror::Error;

/// Impedance of one electrode or of all electrodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Index in the montage; `None` for all electrodes.
    electrode: Option<usize>,
    ohms: f64,
}

/// Why a text is not a valid [`Contact`].
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ContactError {
    /// The text before the colon is not an impedance; holds that text.
    #[error("'{0}' is no impedance; write ohms or kilohms, such as 800 or 5k")]
    NoImpedance(String),
    /// The text after the colon is not an electrode of the model; holds that text.
    #[error("'{0}' is no electrode of the model; its electrodes are {labels}", labels = model::LABELS)]
    NoElectrode(String),
}

impl FromStr for Contact {
    type Err = ContactError;

    fn from_str(text: &str) -> Result<Self, ContactError> {
        let (value, label) = match text.split_once(':') {
            Some((value, label)) => (value, Some(label)),
            None => (text, None),
        };
        let (number, factor) = match value.strip_suffix(['k', 'K']) {
            Some(number) => (number, 1000.0),
            None => (value, 1.0),
        };
        let ohms = number.parse().map(|ohms: f64| ohms * factor).ok();
        let ohms = ohms.filter(|ohms| (0.0..=1e9).contains(ohms));
        let ohms = ohms.ok_or_else(|| ContactError::NoImpedance(value.to_owned()))?;
        let electrode = label.map(|label| {
            let mut labels = model::LABELS.split(' ');
            let found = labels.position(|other| other.eq_ignore_ascii_case(label));
            found.ok_or_else(|| ContactError::NoElectrode(label.to_owned()))
        });
        Ok(Self { electrode: electrode.transpose()?, ohms })
    }
}

/// Impedance of an electrode with a usual gel, in ohms.
const USUAL_OHMS: f64 = 5_000.0;

/// Returns the impedance of each electrode in ohms. Later contacts replace earlier ones; an
/// electrode that no contact names has 5 kOhm.
pub(crate) fn impedances(contacts: &[Contact]) -> [f64; ELECTRODES] {
    let mut ohms = [USUAL_OHMS; ELECTRODES];
    for contact in contacts {
        match contact.electrode {
            None => ohms = [contact.ohms; ELECTRODES],
            Some(electrode) => ohms[electrode] = contact.ohms,
        }
    }
    ohms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_name_an_impedance_and_perhaps_an_electrode() {
        let label = model::LABELS.split(' ').nth(1).expect("two electrodes");
        let texts = ["800".to_owned(), format!("40k:{}", label.to_lowercase())];
        let contacts = texts.map(|text| text.parse().expect("a contact"));
        let found = impedances(&contacts);
        assert_eq!(found[..3], [800.0, 40_000.0, 800.0]);
        assert_eq!(impedances(&[])[..1], [5_000.0]);
        for (text, part) in [("-1", "5k"), ("much", "5k"), ("1e10", "5k"), ("1k:X9", "X9")] {
            let error = text.parse::<Contact>().expect_err(text).to_string();
            assert!(error.contains(part), "{error}");
        }
    }
}
