//! Commands that wait for an acknowledgement.

use link::ToDevice;

/// Time without an acknowledgement after which a command is sent again, microseconds.
pub(crate) const RETRY_US: i64 = 500_000;

/// A command without an acknowledgement, and the sequence numbers of the first and last frame that
/// carried it.
#[derive(Clone, Copy, Debug)]
pub struct PendingCommand {
    /// The command itself.
    pub command: ToDevice,
    /// Sequence number of the frame that carried the command first.
    first_seq: u32,
    /// Sequence number of the most recent frame that carried the command.
    last_seq: u32,
    /// Host time of the last transmission, microseconds.
    sent_us: i64,
}

impl PendingCommand {
    /// Records that `command` was sent in frame `seq` at `now_us`, host time in microseconds.
    pub fn new(command: ToDevice, seq: u32, now_us: i64) -> PendingCommand {
        PendingCommand {
            command,
            first_seq: seq,
            last_seq: seq,
            sent_us: now_us,
        }
    }

    /// Returns this command with one more transmission recorded: frame `seq`, sent at `now_us`.
    pub fn sent_again(self, seq: u32, now_us: i64) -> PendingCommand {
        PendingCommand {
            last_seq: seq,
            sent_us: now_us,
            ..self
        }
    }

    /// Returns whether the timeout has passed after which the command is sent again.
    pub fn retry_is_due(&self, now_us: i64) -> bool {
        now_us >= self.sent_us + RETRY_US
    }

    /// Returns whether more than one frame carried the command.
    pub fn was_sent_again(&self) -> bool {
        self.first_seq != self.last_seq
    }

    /// Returns whether an acknowledgement of frame number `of` belongs to any transmission of this
    /// command, also if the sequence number has wrapped.
    pub fn is_acknowledged_by(&self, of: u32) -> bool {
        of.wrapping_sub(self.first_seq) <= self.last_seq.wrapping_sub(self.first_seq)
    }
}
