//! Construction of one status in a report to `/diagnostics`.

use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

/// Creates a status with `name` and no hardware id. [`diagnose`](super::diagnose) adds the name's
/// prefix and the hardware id.
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
