//! Fault descriptions, truncated to the longest text that a message can carry.

use core::fmt::{self, Write};

use heapless::String;
use link::MAX_TEXT_BYTES;

/// Formats `fault`; text beyond [`MAX_TEXT_BYTES`] is cut off between two characters.
pub fn fault_text(fault: impl fmt::Display) -> String<MAX_TEXT_BYTES> {
    let mut text = Text(String::new());
    // An error means that the text was cut, which is accepted.
    let _ = write!(text, "{fault}");
    text.0
}

/// Text that accepts characters until the first one that does not fit.
struct Text(String<MAX_TEXT_BYTES>);

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            self.0.push(character).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_is_cut_between_characters() {
        let long: std::string::String = core::iter::repeat_n('ä', MAX_TEXT_BYTES).collect();
        let text = fault_text(std::format!("a{long}"));
        assert_eq!(text.chars().count(), MAX_TEXT_BYTES / 2);
        assert_eq!(fault_text("chip 3"), "chip 3");
    }
}
