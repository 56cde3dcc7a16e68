//! Faults that a device reports in `Hello` when it starts.

use device::fault_text;
use heapless::String;
use link::MAX_TEXT_BYTES;

use crate::fault_record::FaultRecord;

/// Fault text of `Hello` if the model in flash does not match its checksum.
pub const MODEL_DAMAGED: &str = "the model in flash is damaged: flash the firmware again";

/// Returns the fault text of `Hello`, the gravest fault first: a damaged model, then the fault of the
/// board, then the fault that ended the firmware before the last reset. Text that does not fit is cut.
pub fn start_fault(
    model_is_sound: bool,
    board: &str,
    previous: Option<&FaultRecord>,
) -> String<MAX_TEXT_BYTES> {
    let model = if model_is_sound { "" } else { MODEL_DAMAGED };
    let previous = previous.map_or("", FaultRecord::text);
    let between = |before: &str, after: &str| {
        if before.is_empty() || after.is_empty() {
            ""
        } else {
            "; "
        }
    };
    let rest = if board.is_empty() { previous } else { board };
    fault_text(format_args!(
        "{model}{}{board}{}{previous}",
        between(model, rest),
        between(board, previous)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_faults_are_reported_the_gravest_first() {
        let failure = FaultRecord::from_failure("panicked");
        let previous = Some(&failure);
        assert_eq!(start_fault(true, "", None), "");
        assert_eq!(start_fault(true, "", previous), "panicked");
        assert_eq!(start_fault(true, "no clock", None), "no clock");
        assert_eq!(
            start_fault(true, "no clock", previous),
            "no clock; panicked"
        );
        assert_eq!(start_fault(false, "", None), MODEL_DAMAGED);
        let all = start_fault(false, "no clock", previous);
        assert!(all.starts_with(MODEL_DAMAGED) && all.ends_with("; no clock; panicked"));
        assert!(start_fault(false, "", previous).ends_with("firmware again; panicked"));
    }
}
