//! Tests of the checks themselves: a check that accepts a faulty board is worth nothing.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs a check and returns the message of its failed assertion; empty where it passes.
pub fn message(check: impl FnOnce()) -> String {
    let Err(panic) = catch_unwind(AssertUnwindSafe(check)) else {
        return String::new();
    };
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "a panic without a message".to_owned())
}

/// Asserts that a check fails with a message that contains `words`.
///
/// # Panics
/// When it passes or has another message.
pub fn assert_refused(words: &str, check: impl FnOnce()) {
    let message = message(check);
    let refused = !message.is_empty() && message.contains(words);
    assert!(refused, "`{words}` expected in the refusal: {message:?}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_of_a_failed_assertion_is_returned() {
        assert_eq!(message(|| ()), "");
        assert_eq!(message(|| panic!("fixed")), "fixed");
        assert_eq!(message(|| panic!("formatted {}", 1)), "formatted 1");
        assert_refused("", || panic!("any"));
        assert_refused("in the refusal", || assert_refused("", || ()));
        assert_refused("in the refusal", || assert_refused("a", || panic!("b")));
    }
}
