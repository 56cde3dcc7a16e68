//! One status of `/diagnostics`.

use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

pub(crate) fn new_status(
    name: &str,
    (level, message): (DiagnosticLevel, String),
    values: Vec<KeyValue>,
) -> DiagnosticStatus {
    let hardware_id = String::new();
    DiagnosticStatus {
        level,
        name: name.to_owned(),
        message,
        hardware_id,
        values,
    }
}
