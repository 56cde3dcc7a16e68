//! What a run leaves to the next one.

use core::fmt::{self, Write};

use link::{ResetCause, ResetInto};

/// Longest text, bytes; what is longer is cut.
const TEXT: usize = 160;

/// Marks a record that was written; anything else is what a memory holds when power comes up.
const WRITTEN: u32 = 0x5245_434f;

/// Why a run ended, in memory that a reset does not touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct FaultRecord {
    written: u32,
    end: u32,
    length: u32,
    text: [u8; TEXT],
    /// Over all of the above.
    sum: u32,
}

/// A panic or a fault.
const FAILED: u32 = 0;
/// A task made no progress.
const HUNG: u32 = 1;
/// The host has asked for it.
const ASKED: u32 = 2;
/// The host has asked for the microcontroller's own loader.
const ASKED_FOR_BOOTLOADER: u32 = 3;

impl FaultRecord {
    /// A record of a panic or a fault, in words.
    pub fn failed(what: impl fmt::Display) -> Self {
        Self::new(FAILED, &what)
    }

    /// A record of a task that made no progress.
    pub fn hung(what: impl fmt::Display) -> Self {
        Self::new(HUNG, &what)
    }

    /// A record of what the host has asked for.
    pub fn asked(into: ResetInto) -> Self {
        match into {
            ResetInto::Bootloader => Self::new(ASKED_FOR_BOOTLOADER, &""),
            ResetInto::Firmware | ResetInto::Newer(_) => Self::new(ASKED, &""),
        }
    }

    fn new(end: u32, what: &dyn fmt::Display) -> Self {
        let mut text = Text {
            bytes: [0; TEXT],
            length: 0,
        };
        // A text that is cut is still a text.
        let _ = write!(text, "{what}");
        let mut record = Self {
            written: WRITTEN,
            end,
            length: u32::try_from(text.length).unwrap_or(0),
            text: text.bytes,
            sum: 0,
        };
        record.sum = record.sum_of_all();
        record
    }

    /// Whether this was written by a run before, and whole.
    pub fn is_sound(&self) -> bool {
        self.written == WRITTEN && self.sum == self.sum_of_all()
    }

    /// The text.
    pub fn text(&self) -> &str {
        let length = usize::try_from(self.length).unwrap_or(TEXT).min(TEXT);
        let text = &self.text[..length];
        match core::str::from_utf8(text) {
            Ok(text) => text,
            // Cut within a letter.
            Err(error) => core::str::from_utf8(&text[..error.valid_up_to()]).unwrap_or(""),
        }
    }

    /// What it is to the host.
    pub const fn cause(&self) -> ResetCause {
        match self.end {
            HUNG => ResetCause::Watchdog,
            ASKED | ASKED_FOR_BOOTLOADER => ResetCause::Software,
            _ => ResetCause::Fault,
        }
    }

    /// Whether the microcontroller's own loader shall run in place of this program.
    pub const fn asks_for_bootloader(&self) -> bool {
        self.end == ASKED_FOR_BOOTLOADER
    }

    /// FNV-1a (Fowler, Noll and Vo; 32 bits). Once in an image: unrolled it takes a kilobyte.
    #[inline(never)]
    fn sum_of_all(&self) -> u32 {
        let words = [self.written, self.end, self.length].map(u32::to_le_bytes);
        let bytes = words.as_flattened().iter().chain(&self.text);
        bytes.fold(0x811c_9dc5, |sum, &byte| {
            (sum ^ u32::from(byte)).wrapping_mul(0x0100_0193)
        })
    }
}

/// Takes what fits.
struct Text {
    bytes: [u8; TEXT],
    length: usize,
}

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = &mut self.bytes[self.length..];
        let length = text.len().min(room.len());
        room[..length].copy_from_slice(&text.as_bytes()[..length]);
        self.length += length;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::string::String;

    use super::*;

    #[test]
    fn a_record_says_what_was_written_and_a_single_bit_makes_it_none() {
        let record = FaultRecord::failed(format_args!("panicked at {}", "encode.rs:7"));
        assert!(record.is_sound());
        assert_eq!(record.text(), "panicked at encode.rs:7");
        assert_eq!(record.cause(), ResetCause::Fault);
        let mut damaged = record;
        damaged.text[3] ^= 1;
        assert!(!damaged.is_sound());
        assert_eq!(FaultRecord::hung("encode").cause(), ResetCause::Watchdog);
        for (into, bootloader) in [(ResetInto::Firmware, false), (ResetInto::Bootloader, true)] {
            let asked = FaultRecord::asked(into);
            assert!(asked.is_sound() && asked.text().is_empty());
            assert_eq!(asked.cause(), ResetCause::Software);
            assert_eq!(asked.asks_for_bootloader(), bootloader);
        }
    }

    #[test]
    fn a_long_text_is_cut_between_letters() {
        let long: String = core::iter::repeat_n('ä', TEXT).collect();
        let record = FaultRecord::failed(std::format!("a{long}"));
        assert!(record.is_sound());
        assert_eq!(record.text().chars().count(), TEXT / 2);
    }
}
