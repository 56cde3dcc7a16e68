//! Construction of one status of `/diagnostics`.

use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

/// Creates a status without the prefix of its name and without a hardware id; both are set when the
/// report is complete.
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
