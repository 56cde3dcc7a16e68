//! What is wrong, in words.

use core::fmt::{self, Write};

use heapless::String;
use link::MAX_TEXT_BYTES;

/// What something says of itself, as long as it fits a message.
pub fn fault_text(what: impl fmt::Display) -> String<MAX_TEXT_BYTES> {
    let mut text = Text(String::new());
    // A text that is cut is still a text.
    let _ = write!(text, "{what}");
    text.0
}

/// Takes what fits, up to the last whole letter.
struct Text(String<MAX_TEXT_BYTES>);

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for letter in text.chars() {
            self.0.push(letter).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_is_cut_between_letters() {
        let long: std::string::String = core::iter::repeat_n('ä', MAX_TEXT_BYTES).collect();
        let text = fault_text(std::format!("a{long}"));
        assert_eq!(text.chars().count(), MAX_TEXT_BYTES / 2);
        assert_eq!(fault_text("chip 3"), "chip 3");
    }
}
