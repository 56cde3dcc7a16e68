//! The messages of `/diagnostics` and `/rosout`, and a message that holds one number.

use serde::Serialize;

use crate::rosneuro_msgs::Header;
use crate::wire::{Reader, Wire, WireError, impl_wire};

/// `diagnostic_msgs/DiagnosticArray`: status reports of several components.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DiagnosticArray {
    /// `header.stamp` is the time at which the reports were made; `frame_id` is empty.
    pub header: Header,
    /// One entry per component.
    pub status: Vec<DiagnosticStatus>,
}

impl_wire!(DiagnosticArray { header, status });

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

impl_wire!(DiagnosticStatus { level, name, message, hardware_id, values });

impl DiagnosticStatus {
    /// Creates the status `corticode: NAME` of a component without a hardware id.
    pub fn new(
        name: &str,
        (level, message): (DiagnosticLevel, String),
        values: Vec<KeyValue>,
    ) -> DiagnosticStatus {
        DiagnosticStatus {
            level,
            name: format!("corticode: {name}"),
            message,
            hardware_id: String::new(),
            values,
        }
    }
}

/// `diagnostic_msgs/KeyValue`: a named value.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct KeyValue {
    /// Name with unit, such as `round trip us`.
    pub key: String,
    /// Formatted value without its unit.
    pub value: String,
}

impl_wire!(KeyValue { key, value });

impl KeyValue {
    /// Creates an entry named `key`, which includes the unit; `value` is formatted with `Display`.
    pub fn new(key: &str, value: &dyn std::fmt::Display) -> KeyValue {
        KeyValue { key: key.to_owned(), value: value.to_string() }
    }
}

/// Severity of a status; one byte on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DiagnosticLevel {
    /// Normal operation; 0 on the wire.
    #[default]
    Ok = 0,
    /// Degraded operation; 1 on the wire.
    Warn = 1,
    /// Failure; 2 on the wire.
    Error = 2,
    /// No recent data; 3 on the wire.
    Stale = 3,
}

impl Wire for DiagnosticLevel {
    const MIN_BYTES: usize = 1;

    fn write(&self, out: &mut Vec<u8>) {
        (*self as u8).write(out);
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

/// `rosgraph_msgs/Log`: one line of a node's log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Log {
    /// Sequence number and time of the line; `frame_id` is empty.
    pub header: Header,
    /// Severity: one of [`Log::INFO`], [`Log::WARN`] and [`Log::ERROR`], or 1 for debug messages
    /// and 16 for fatal ones.
    pub level: u8,
    /// Full name of the node.
    pub name: String,
    /// Text of the line.
    pub msg: String,
    /// Source file, if known.
    pub file: String,
    /// Function or module, if known.
    pub function: String,
    /// Line in the source file; 0 if unknown.
    pub line: u32,
    /// Topics that the node publishes; can be empty.
    pub topics: Vec<String>,
}

impl Log {
    /// Value of [`Log::level`] for normal messages.
    pub const INFO: u8 = 2;
    /// Value of [`Log::level`] for warnings.
    pub const WARN: u8 = 4;
    /// Value of [`Log::level`] for errors.
    pub const ERROR: u8 = 8;
}

impl_wire!(Log { header, level, name, msg, file, function, line, topics });

/// `std_msgs/UInt8`: one number of 8 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UInt8 {
    /// Number that the message carries.
    pub data: u8,
}

impl_wire!(UInt8 { data });
