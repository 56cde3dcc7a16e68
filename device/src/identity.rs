//! Who the device says it is.

use link::{Hello, ResetCause};

/// Who the device says it is, from boot to boot.
#[derive(Clone, Debug)]
pub struct Identity<'i> {
    /// Version of the firmware, at most [`link::MAX_TEXT_BYTES`].
    pub firmware: &'i str,
    /// Board, at most [`link::MAX_TEXT_BYTES`].
    pub board: &'i str,
    /// Unique id of the microcontroller.
    pub chip_uid: [u8; 12],
    /// Differs from boot to boot.
    pub session_id: u32,
    /// Why the device started.
    pub reset_cause: ResetCause,
    /// What is wrong with the start, or was with the last run; empty when nothing is. At most
    /// [`link::MAX_TEXT_BYTES`].
    pub fault: &'i str,
}

impl Identity<'_> {
    /// As it goes over the wire.
    pub(crate) const fn hello(&self) -> Hello<'_> {
        Hello {
            firmware: self.firmware,
            board: self.board,
            chip_uid: self.chip_uid,
            model_id: model::MODEL_ID,
            session_id: self.session_id,
            reset_cause: self.reset_cause,
            fault: self.fault,
        }
    }
}
