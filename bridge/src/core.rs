//! Frame decoder and session, without input and output.

use std::sync::Arc;

use link::{Counters, Decoder, MAX_FRAME, ToHost};
use neuro_ros::DiagnosticArray;

use crate::decoder::model::Model;
use crate::diagnostics::diagnose;
use crate::diagnostics::summary::Summary;
use crate::effects::Effects;
use crate::session::state::Session;
use crate::settings::Settings;
use crate::time::host_time::HostTime;

/// The pure core of the bridge: bytes and times in, [`Effects`] out.
///
/// `Core` reads no clock and no port, so tests can reproduce every fault of a link exactly.
#[derive(Debug)]
pub struct Core {
    decoder: Decoder<MAX_FRAME>,
    session: Session,
}

impl Core {
    /// Creates a disconnected core. Without a model, codes are published but not decoded.
    pub fn new(settings: Settings, model: Option<Arc<Model>>) -> Core {
        Core {
            decoder: Decoder::new(),
            session: Session::new(settings, model),
        }
    }

    /// Handles the opening of a port: sends the first command.
    pub fn connected(&mut self, now: HostTime, effects: &mut dyn Effects) {
        self.decoder.reset();
        self.session.connected(now, effects);
    }

    /// Handles the closing or loss of the port. The state of the streams is kept for a
    /// reconnection.
    pub fn disconnected(&mut self) {
        self.session.disconnected();
    }

    /// Handles bytes from the device that were read at `read`, and sends the command that is due.
    pub fn receive(&mut self, mut bytes: &[u8], read: HostTime, effects: &mut dyn Effects) {
        while let Some(outcome) = self.decoder.next::<ToHost>(&mut bytes) {
            match outcome {
                Ok(frame) => self.session.handle_frame(&frame, read, effects),
                Err(error) => self.session.handle_error(error, read),
            }
        }
        self.session.tick(read, effects);
    }

    /// Sends the command that is due, if any. Call this at least every 100 ms.
    pub fn tick(&mut self, now: HostTime, effects: &mut dyn Effects) {
        self.session.tick(now, effects);
    }

    /// Sets whether the device shall stream. The next [`Core::tick`] sends the command.
    pub fn set_streaming(&mut self, streaming: bool) {
        self.session.commands.set_streaming(streaming);
    }

    /// Returns whether no stream is wanted and the device has confirmed that it stopped.
    pub fn is_stopped(&self) -> bool {
        self.session.commands.is_stopped()
    }

    /// Returns whether the port has been silent for more than 5 s, so that it should be reopened.
    pub fn is_unresponsive(&self, now: HostTime) -> bool {
        self.session.commands.is_unresponsive(now.monotonic_us)
    }

    /// Returns the frame decoder's counts of bytes, frames and errors.
    pub fn wire_counters(&self) -> &Counters {
        self.decoder.counters()
    }

    /// Returns the counts of received, lost and filled data so far.
    pub fn summary(&self) -> Summary {
        Summary::new(&self.session, self.decoder.counters())
    }

    /// Returns the report for `/diagnostics`. Call this once a second: a loss is a warning in the
    /// first report after it only.
    pub fn diagnostics(&mut self, now: HostTime) -> DiagnosticArray {
        diagnose(&mut self.session, self.decoder.counters(), now)
    }
}
