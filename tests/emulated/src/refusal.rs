//! Tests of the checks themselves: a check that accepts a faulty board is worth nothing.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs a check and returns the message of its failed assertion; empty where it passes.
pub fn message(check: impl FnOnce()) -> String {
    match catch_unwind(AssertUnwindSafe(check)) {
        Ok(()) => String::new(),
        Err(panic) => match panic.downcast::<String>() {
            Ok(message) => *message,
            Err(panic) => panic
                .downcast::<&str>()
                .map_or("a panic without a message".to_owned(), |message| {
                    (*message).to_owned()
                }),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_of_a_failed_assertion_is_returned() {
        assert_eq!(message(|| assert!(message(|| ()).is_empty())), "");
        assert_eq!(message(|| panic!("fixed")), "fixed");
        assert_eq!(message(|| panic!("formatted {}", 1)), "formatted 1");
    }
}
