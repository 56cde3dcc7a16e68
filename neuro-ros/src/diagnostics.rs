//! What goes to `/diagnostics`.

use serde::Serialize;

use crate::wire::fields;
use crate::{Header, Reader, Wire, WireError};

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DiagnosticArray {
    /// When; `frame_id` is empty.
    pub header: Header,
    /// One entry per part that has something to say.
    pub status: Vec<DiagnosticStatus>,
}

fields!(DiagnosticArray { header: Header, status: Vec<DiagnosticStatus> });

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DiagnosticStatus {
    /// How bad.
    pub level: DiagnosticLevel,
    /// Which part, such as `corticode: link`.
    pub name: String,
    /// One line for people.
    pub message: String,
    /// Which hardware.
    pub hardware_id: String,
    /// The figures.
    pub values: Vec<KeyValue>,
}

fields!(DiagnosticStatus {
    level: DiagnosticLevel,
    name: String,
    message: String,
    hardware_id: String,
    values: Vec<KeyValue>,
});

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct KeyValue {
    /// Name of the figure.
    pub key: String,
    /// The figure as text.
    pub value: String,
}

fields!(KeyValue {
    key: String,
    value: String
});

impl KeyValue {
    /// A figure and its name.
    pub fn new(key: &str, value: &dyn std::fmt::Display) -> KeyValue {
        KeyValue {
            key: key.to_owned(),
            value: value.to_string(),
        }
    }
}

/// `DiagnosticStatus.level`; one byte on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DiagnosticLevel {
    /// 0
    #[default]
    Ok,
    /// 1
    Warn,
    /// 2
    Error,
    /// 3: no news for too long.
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

    /// A level that the message does not define reads as [`DiagnosticLevel::Error`].
    fn read(reader: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(match u8::read(reader)? {
            0 => DiagnosticLevel::Ok,
            1 => DiagnosticLevel::Warn,
            3 => DiagnosticLevel::Stale,
            _ => DiagnosticLevel::Error,
        })
    }
}
