//! Plays a recording inside this program, in place of the connection to a device.

use std::fs::File;
use std::path::PathBuf;

use bridge_core::HostTime;
use capture::{FileHeader, RecordingError, Replayer};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};
use tokio::time::sleep_until;

use crate::app::replay::next_due;
use crate::error::BridgeError;
use crate::wire::connection::{Event, Feed};

/// Plays a recording in real time, and answers commands as the recorded device did.
pub(crate) struct ReplayFeed {
    replayer: Replayer<File>,
    path: PathBuf,
    is_open: bool,
    /// Bytes that did not fit into the caller's buffer; the next call returns them.
    waiting: Vec<u8>,
}

impl ReplayFeed {
    pub(crate) fn new(replayer: Replayer<File>, path: PathBuf) -> ReplayFeed {
        ReplayFeed { replayer, path, is_open: false, waiting: Vec::new() }
    }

    pub(crate) fn header(&self) -> &FileHeader {
        self.replayer.header()
    }

    fn unusable(&self, error: RecordingError) -> BridgeError {
        BridgeError::Recording(self.path.clone(), error)
    }
}

impl Feed for ReplayFeed {
    /// Cancel safe: bytes that a cancelled call has played are returned by the next call.
    async fn next_event(
        &mut self,
        buffer: &mut [u8],
        outgoing: &mut Vec<u8>,
    ) -> Result<Event, BridgeError> {
        if !std::mem::replace(&mut self.is_open, true) {
            return Ok(Event::Opened);
        }
        loop {
            let commands = std::mem::take(outgoing);
            let answered = self.replayer.receive(&commands);
            answered.map_err(|error| self.unusable(error))?;
            self.waiting.extend(self.replayer.take());
            if !self.waiting.is_empty() {
                let count = self.waiting.len().min(buffer.len());
                buffer[..count].copy_from_slice(&self.waiting[..count]);
                self.waiting.drain(..count);
                return Ok(Event::Bytes(count));
            }
            let Some(due) = next_due(&self.replayer, 0) else {
                // Nothing is due until the caller drops this future and calls again with a command.
                return std::future::pending().await;
            };
            sleep_until(due).await;
            let played = self.replayer.play(HostTime::now().monotonic_us);
            played.map_err(|error| self.unusable(error))?;
        }
    }

    fn is_open(&self) -> bool {
        self.is_open
    }

    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn status(&mut self) -> Option<DiagnosticStatus> {
        let counts = self.replayer.counts();
        let message = if self.replayer.is_finished() {
            "the recording is at its end; Stop, and then Start, play it again"
        } else {
            "plays"
        };
        Some(DiagnosticStatus::new(
            "replay",
            (DiagnosticLevel::Ok, message.to_owned()),
            vec![
                KeyValue::new("file", &self.path.display()),
                KeyValue::new("frames", &counts.frames),
                KeyValue::new("frames left out", &counts.unusable),
            ],
        ))
    }
}
