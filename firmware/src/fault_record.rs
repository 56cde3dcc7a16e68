//! Record of why the firmware ended, from which the next boot takes the fault text of `Hello`.

use core::fmt::{self, Write};

use device::fault_text;
use heapless::String;
use link::{MAX_TEXT_BYTES, ResetCause, ResetInto};

/// Largest number of text bytes in a record; longer text is cut.
const TEXT_BYTES: usize = 160;

/// Value of the first word of a valid record. After power-on, the memory holds random bits instead.
const MAGIC: u32 = 0x5245_434f;

/// Why the firmware ended: a reason and a text. The record is in memory that survives a reset; a
/// checksum distinguishes it from the random bits after power-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct FaultRecord {
    magic: u32,
    /// Why the firmware ended: [`FAILURE`], [`HANG`], [`RESTART`] or [`RESTART_INTO_BOOTLOADER`].
    reason: u32,
    /// Number of bytes of `text` in use.
    length: u32,
    text: [u8; TEXT_BYTES],
    /// FNV-1a hash of all fields above.
    checksum: u32,
}

/// Reason: a panic or a processor fault.
const FAILURE: u32 = 0;
/// Reason: a task made no progress, so the watchdog expired.
const HANG: u32 = 1;
/// Reason: the host commanded a reset.
const RESTART: u32 = 2;
/// Reason: the host commanded a reset into the microcontroller's own boot loader.
const RESTART_INTO_BOOTLOADER: u32 = 3;

impl FaultRecord {
    /// Creates the record of a panic or a processor fault.
    pub fn from_failure(description: impl fmt::Display) -> Self {
        Self::new(FAILURE, &description)
    }

    /// Creates the record of a hang: a task made no progress, so the watchdog expires.
    pub fn from_hang(description: impl fmt::Display) -> Self {
        Self::new(HANG, &description)
    }

    /// Creates the record of a reset that the host commanded; the text is empty.
    pub fn from_restart(into: ResetInto) -> Self {
        match into {
            ResetInto::Bootloader => Self::new(RESTART_INTO_BOOTLOADER, &""),
            ResetInto::Firmware | ResetInto::Newer(_) => Self::new(RESTART, &""),
        }
    }

    fn new(reason: u32, description: &dyn fmt::Display) -> Self {
        let mut text = Text { bytes: [0; TEXT_BYTES], length: 0 };
        // `Text` never returns an error; it drops the bytes that do not fit.
        let _ = write!(text, "{description}");
        let mut record = Self {
            magic: MAGIC,
            reason,
            length: u32::try_from(text.length).unwrap_or(0),
            text: text.bytes,
            checksum: 0,
        };
        record.checksum = record.compute_checksum();
        record
    }

    /// Returns whether the memory holds a complete record, and not random bits.
    pub fn is_valid(&self) -> bool {
        self.magic == MAGIC && self.checksum == self.compute_checksum()
    }

    /// Returns the record's text, without an incomplete last character.
    pub fn text(&self) -> &str {
        let length = usize::try_from(self.length).unwrap_or(TEXT_BYTES).min(TEXT_BYTES);
        let text = &self.text[..length];
        match core::str::from_utf8(text) {
            Ok(text) => text,
            // `new` has cut the text within a character: leave out what is left of this character.
            Err(error) => core::str::from_utf8(&text[..error.valid_up_to()]).unwrap_or(""),
        }
    }

    /// Returns the reset cause that `Hello` reports for this record.
    pub const fn reset_cause(&self) -> ResetCause {
        match self.reason {
            HANG => ResetCause::Watchdog,
            RESTART | RESTART_INTO_BOOTLOADER => ResetCause::Software,
            _ => ResetCause::Fault,
        }
    }

    /// Returns whether the reset must start the microcontroller's own boot loader instead of the
    /// firmware.
    pub const fn requests_bootloader(&self) -> bool {
        self.reason == RESTART_INTO_BOOTLOADER
    }

    /// Returns the 32-bit FNV-1a hash (Fowler, Noll and Vo) of all fields before `checksum`. Not
    /// inlined: the compiler unrolls the loop, and every inlined copy would take a kilobyte of
    /// flash.
    #[inline(never)]
    fn compute_checksum(&self) -> u32 {
        let words =
            [self.magic.to_le_bytes(), self.reason.to_le_bytes(), self.length.to_le_bytes()];
        let bytes = words.as_flattened().iter().chain(&self.text);
        bytes.fold(0x811c_9dc5, |sum, &byte| (sum ^ u32::from(byte)).wrapping_mul(0x0100_0193))
    }
}

/// Writer that keeps the first `TEXT_BYTES` bytes and drops the rest.
struct Text {
    bytes: [u8; TEXT_BYTES],
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

/// Fault text of `Hello` if the checksum of the model in flash is wrong.
pub const MODEL_DAMAGED: &str = "the model in flash is damaged: flash the firmware again";

/// Returns the fault text of `Hello`, the gravest fault first: a damaged model, the fault of the
/// board, the fault that ended the firmware before the last reset. Text that does not fit is cut.
pub fn start_fault(
    model_is_sound: bool,
    board: &str,
    previous: Option<&FaultRecord>,
) -> String<MAX_TEXT_BYTES> {
    let model = if model_is_sound { "" } else { MODEL_DAMAGED };
    let previous = previous.map_or("", FaultRecord::text);
    let between = |before: &str, after: &str| {
        if before.is_empty() || after.is_empty() { "" } else { "; " }
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
    use std::string::String;

    use super::*;

    #[test]
    fn a_record_keeps_its_text_and_cause_and_one_flipped_bit_makes_it_invalid() {
        let record = FaultRecord::from_failure(format_args!("panicked at {}", "encode.rs:7"));
        assert!(record.is_valid());
        assert_eq!(record.text(), "panicked at encode.rs:7");
        assert_eq!(record.reset_cause(), ResetCause::Fault);
        let mut damaged = record;
        damaged.text[3] ^= 1;
        assert!(!damaged.is_valid());
        assert_eq!(FaultRecord::from_hang("encode").reset_cause(), ResetCause::Watchdog);
        for (into, bootloader) in [(ResetInto::Firmware, false), (ResetInto::Bootloader, true)] {
            let restart = FaultRecord::from_restart(into);
            assert!(restart.is_valid() && restart.text().is_empty());
            assert_eq!(restart.reset_cause(), ResetCause::Software);
            assert_eq!(restart.requests_bootloader(), bootloader);
        }
    }

    #[test]
    fn a_long_text_is_cut_between_characters() {
        let long: String = core::iter::repeat_n('ä', TEXT_BYTES).collect();
        let record = FaultRecord::from_failure(std::format!("a{long}"));
        assert!(record.is_valid());
        assert_eq!(record.text().chars().count(), TEXT_BYTES / 2);
    }

    #[test]
    fn all_faults_are_reported_the_gravest_first() {
        let failure = FaultRecord::from_failure("panicked");
        let previous = Some(&failure);
        assert_eq!(start_fault(true, "", None), "");
        assert_eq!(start_fault(true, "", previous), "panicked");
        assert_eq!(start_fault(true, "no clock", None), "no clock");
        assert_eq!(start_fault(true, "no clock", previous), "no clock; panicked");
        assert_eq!(start_fault(false, "", None), MODEL_DAMAGED);
        let all = start_fault(false, "no clock", previous);
        assert!(all.starts_with(MODEL_DAMAGED) && all.ends_with("; no clock; panicked"));
        assert!(start_fault(false, "", previous).ends_with("firmware again; panicked"));
    }
}
