//! The messages of the topic `/diagnostics`.

use serde::Serialize;

use crate::header::Header;
use crate::wire::{Reader, Wire, WireError, impl_wire};

/// `diagnostic_msgs/DiagnosticArray`: status reports of several components.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DiagnosticArray {
    /// `header.stamp` is the time at which the reports were made; `frame_id` is empty.
    pub header: Header,
    /// One entry per component.
    pub status: Vec<DiagnosticStatus>,
}

impl_wire!(DiagnosticArray { header: Header, status: Vec<DiagnosticStatus> });

/// `diagnostic_msgs/DiagnosticStatus`: the status of one component.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DiagnosticStatus {
    /// Severity of `message`.
    pub level: DiagnosticLevel,
    /// Name of the component, such as `corticode: link`.
    pub name: String,
    /// One-line summary for the user.
    pub message: String,
    /// Identifier of the individual device, such as its unique ID.
    pub hardware_id: String,
    /// Measured values of the component, each with a name and a unit.
    pub values: Vec<KeyValue>,
}

impl_wire!(DiagnosticStatus {
    level: DiagnosticLevel,
    name: String,
    message: String,
    hardware_id: String,
    values: Vec<KeyValue>,
});

/// `diagnostic_msgs/KeyValue`: a named value.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct KeyValue {
    /// Name with unit, such as `round trip us`.
    pub key: String,
    /// Formatted value without its unit.
    pub value: String,
}

impl_wire!(KeyValue {
    key: String,
    value: String
});

impl KeyValue {
    /// Creates an entry named `key`, which includes the unit; `value` is formatted with `Display`.
    pub fn new(key: &str, value: &dyn std::fmt::Display) -> KeyValue {
        KeyValue {
            key: key.to_owned(),
            value: value.to_string(),
        }
    }
}

/// Severity of a status; one byte on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DiagnosticLevel {
    /// Normal operation; 0 on the wire.
    #[default]
    Ok,
    /// Degraded operation; 1 on the wire.
    Warn,
    /// Failure; 2 on the wire.
    Error,
    /// No recent data; 3 on the wire.
    Stale,
}

impl Wire for DiagnosticLevel {
    const MIN_BYTES: usize = 1;

    fn write(&self, out: &mut Vec<u8>) {
        let byte: u8 = match self {
            DiagnosticLevel::Ok => 0,
            DiagnosticLevel::Warn => 1,
            DiagnosticLevel::Error => 2,
            DiagnosticLevel::Stale => 3,
        };
        byte.write(out);
    }

    /// Reads one byte. Values that the message definition does not contain become
    /// [`DiagnosticLevel::Error`].
    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(match u8::read(reader)? {
            0 => DiagnosticLevel::Ok,
            1 => DiagnosticLevel::Warn,
            3 => DiagnosticLevel::Stale,
            _ => DiagnosticLevel::Error,
        })
    }
}
