//! Identity of the device, from its `Hello`.

use std::fmt;

use link::{Hello, ResetCause};

use crate::wire::words;

/// Owned copy of the device's [`Hello`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    firmware: String,
    board: String,
    chip_uid: [u8; 12],
    model_id: [u8; 8],
    session_id: u32,
    reset_cause: ResetCause,
    fault: String,
}

impl Identity {
    /// Copies the identity in `hello`.
    pub fn new(hello: &Hello) -> Identity {
        Identity {
            firmware: hello.firmware.to_owned(),
            board: hello.board.to_owned(),
            chip_uid: hello.chip_uid,
            model_id: hello.model_id,
            session_id: hello.session_id,
            reset_cause: hello.reset_cause,
            fault: hello.fault.to_owned(),
        }
    }

    /// Returns the `Hello` with this identity.
    pub fn as_hello(&self) -> Hello<'_> {
        Hello {
            firmware: &self.firmware,
            board: &self.board,
            chip_uid: self.chip_uid,
            model_id: self.model_id,
            session_id: self.session_id,
            reset_cause: self.reset_cause,
            fault: &self.fault,
        }
    }

    /// Returns whether `hello` was sent by the same device since the same boot.
    pub fn is_same_session(&self, hello: &Hello) -> bool {
        self.session_id == hello.session_id
            && self.chip_uid == hello.chip_uid
            && self.model_id == hello.model_id
    }
}

impl fmt::Display for Identity {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "{} with firmware {}, session {:08x}, started by {}",
            self.board,
            self.firmware,
            self.session_id,
            words::reset_cause(self.reset_cause)
        )
    }
}
