//! The log of a port from which no frames arrive.

use link::Counters;

/// Logs each silence of a port once, however often the port is reopened.
#[derive(Debug, Default)]
pub(crate) struct SilenceLog {
    /// Number of frames received when the last silence was logged.
    frames: Option<u32>,
}

impl SilenceLog {
    /// Logs a silence, unless it is the one that was logged last.
    pub(crate) fn log(&mut self, port: &str, wire: &Counters) {
        if self.frames.replace(wire.frames) == Some(wire.frames) {
            return;
        }
        if wire.frames == 0 {
            tracing::error!(
                "nothing here speaks Corticode: {port} sent {} bytes and no frame; check that \
                 --port names the board's port, that --baud is the board's, and that the board \
                 runs Corticode's firmware; trying again without further messages",
                wire.bytes
            );
        } else {
            tracing::warn!(
                "the device at {port} is silent; waiting for it, and reopening the port if it stays silent"
            );
        }
    }
}
