//! Impedance of the electrodes, which the device measures about every second, or every two seconds
//! at an ADC rate of 250 Hz.

use std::fmt;

use link::Impedance;
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};
use serde::Serialize;

use crate::device::channel_label;

/// Impedance below which a contact is good, in ohms: the usual limit for gel electrodes.
const GOOD_OHMS: u32 = 5_000;
/// Impedance at and above which a contact is bad, in ohms.
const BAD_OHMS: u32 = 20_000;
/// Impedance below which a measurement is implausible for an electrode on skin, in ohms.
const IMPLAUSIBLE_OHMS: u32 = 100;

/// Impedance of all electrodes in one measurement; displays as a table.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ImpedanceReport {
    /// Electrodes in the order of the montage.
    pub electrodes: Vec<ElectrodeImpedance>,
}

/// Impedance and class of the contact of one electrode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ElectrodeImpedance {
    /// Label of the electrode, such as `Cz`.
    pub electrode: String,
    /// Impedance in ohms, less the series resistance that the user states for the board; `None` if
    /// the electrode is open.
    pub ohms: Option<u32>,
    /// Class of the contact by its impedance.
    pub contact: Contact,
}

/// Class of an electrode's contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Contact {
    /// Below 5 kOhm.
    Good,
    /// At least 5 kOhm and below 20 kOhm.
    Fair,
    /// 20 kOhm or more.
    Bad,
    /// Disconnected, above the range of 1 MOhm, or at the converter's rail.
    Open,
    /// Below 0.1 kOhm, series resistance included: short-circuited, or without excitation.
    Implausible,
}

impl ImpedanceReport {
    /// Creates the report of a measurement of the electrodes `labels`. `series_ohms` is the
    /// resistance in series with each electrode on the board.
    pub(crate) fn new(impedance: &Impedance, labels: &[String], series_ohms: u32) -> Self {
        let electrodes = impedance.electrodes().enumerate().map(|(index, ohms)| {
            let contact = match ohms {
                Some(ohms) if ohms < IMPLAUSIBLE_OHMS => Contact::Implausible,
                Some(ohms) => Contact::of_ohms(ohms.saturating_sub(series_ohms)),
                None => Contact::Open,
            };
            ElectrodeImpedance {
                electrode: channel_label(labels, index),
                ohms: ohms.map(|ohms| ohms.saturating_sub(series_ohms)),
                contact,
            }
        });
        Self { electrodes: electrodes.collect() }
    }

    /// Returns the status `impedance`. The message names the electrodes without a usable contact.
    pub(crate) fn status(&self) -> DiagnosticStatus {
        let with = |what: &str, contact: Contact| {
            let named = self.electrodes.iter().filter(|one| one.contact == contact);
            let named: Vec<&str> = named.map(|one| one.electrode.as_str()).collect();
            (!named.is_empty()).then(|| format!("{what}: {}", named.join(" ")))
        };
        let faults: Vec<String> = [
            with("open", Contact::Open),
            with("20 kOhm or more", Contact::Bad),
            with("short-circuited or without excitation", Contact::Implausible),
        ]
        .into_iter()
        .flatten()
        .collect();
        let state = if faults.is_empty() {
            let message = format!("{} electrodes below 20 kOhm", self.electrodes.len());
            (DiagnosticLevel::Ok, message)
        } else {
            (DiagnosticLevel::Warn, faults.join("; "))
        };
        let values = self.electrodes.iter();
        let values = values.map(|one| KeyValue::new(&one.electrode, &one.words()));
        DiagnosticStatus::new("impedance", state, values.collect())
    }
}

impl Contact {
    const fn of_ohms(ohms: u32) -> Self {
        match ohms {
            0..GOOD_OHMS => Self::Good,
            GOOD_OHMS..BAD_OHMS => Self::Fair,
            BAD_OHMS.. => Self::Bad,
        }
    }
}

impl ElectrodeImpedance {
    /// Returns the impedance with its unit, such as "4.9 kOhm", or "open".
    fn words(&self) -> String {
        match self.ohms {
            Some(_) => format!("{} kOhm", self.kohm()),
            None => "open".to_owned(),
        }
    }

    /// Returns the impedance in kilohms with one decimal place, or "open".
    pub fn kohm(&self) -> String {
        self.ohms
            .map_or_else(|| "open".to_owned(), |ohms| format!("{:.1}", f64::from(ohms) / 1000.0))
    }
}

/// Number of electrodes in a line of the table.
const COLUMNS: usize = 8;

impl ImpedanceReport {
    /// Returns the table: each electrode with its impedance in kilohms, eight in a line. `paint`
    /// colours a cell by its class.
    pub fn table(&self, paint: impl Fn(Contact, String) -> String) -> String {
        let lines = self.electrodes.chunks(COLUMNS).map(|line| {
            let cells = line.iter().map(|one| {
                let cell = format!("{:>4} {:>6}", one.electrode, one.kohm());
                paint(one.contact, cell)
            });
            cells.collect::<Vec<_>>().join("  ")
        });
        lines.collect::<Vec<_>>().join("\n")
    }
}

/// Writes the table without colours.
impl fmt::Display for ImpedanceReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.table(|_, cell| cell))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(ohms: &[u32], series_ohms: u32) -> ImpedanceReport {
        let bytes: Vec<u8> = ohms.iter().flat_map(|ohms| ohms.to_le_bytes()).collect();
        let labels = ["Fp1", "Fp2", "Cz", "Pz", "Oz"].map(str::to_owned);
        let impedance = Impedance { ohms: &bytes };
        ImpedanceReport::new(&impedance, &labels, series_ohms)
    }

    #[test]
    fn electrodes_without_a_usable_contact_are_named() {
        let measured = [4_999, 5_000, 20_000, Impedance::OPEN, 30];
        let status = report(&measured, 0).status();
        assert_eq!(status.level, DiagnosticLevel::Warn);
        assert_eq!(
            status.message,
            "open: Pz; 20 kOhm or more: Cz; short-circuited or without excitation: Oz"
        );
        let values: Vec<&str> = status.values.iter().map(|one| one.value.as_str()).collect();
        assert_eq!(values, ["5.0 kOhm", "5.0 kOhm", "20.0 kOhm", "open", "0.0 kOhm"]);
        let good = report(&measured[..2], 0).status();
        assert_eq!(good.level, DiagnosticLevel::Ok);
        assert_eq!(good.message, "2 electrodes below 20 kOhm");
    }

    #[test]
    fn the_resistance_of_the_board_is_subtracted() {
        let report = report(&[22_100, 2_000, 50], 2_200);
        let contacts: Vec<Contact> = report.electrodes.iter().map(|one| one.contact).collect();
        assert_eq!(contacts, [Contact::Fair, Contact::Good, Contact::Implausible]);
        assert_eq!(report.electrodes[0].ohms, Some(19_900));
        assert_eq!(report.to_string(), " Fp1   19.9   Fp2    0.0    Cz    0.0");
        let json = serde_json::to_string(&report.electrodes[0]).expect("plain values");
        assert_eq!(json, r#"{"electrode":"Fp1","ohms":19900,"contact":"fair"}"#);
    }
}
