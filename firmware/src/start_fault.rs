//! What is wrong with a start.

use device::fault_text;
use heapless::String;
use link::MAX_TEXT_BYTES;

use crate::{FaultRecord, MODEL_DAMAGED};

/// What a device that has just started reports in `Hello`, the gravest first: a damaged model, what the
/// board finds wrong with itself, and the record of the previous run. What does not fit is cut.
pub fn start_fault(
    model_is_sound: bool,
    board: &str,
    previous_run: Option<&FaultRecord>,
) -> String<MAX_TEXT_BYTES> {
    let model = if model_is_sound { "" } else { MODEL_DAMAGED };
    let previous = previous_run.map_or("", FaultRecord::text);
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
    fn all_that_is_wrong_is_reported_the_gravest_first() {
        let failed = FaultRecord::failed("panicked");
        let previous = Some(&failed);
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
