//! The bridge without the world: bytes and times in, effects out.

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

/// The bridge without the world: bytes and times in, [`Effects`] out. Pure, so that everything
/// that can go wrong on a link is tested without one.
#[derive(Debug)]
pub struct Core {
    decoder: Decoder<MAX_FRAME>,
    session: Session,
}

impl Core {
    /// Nothing is connected yet. Without a model nothing is reconstructed.
    pub fn new(settings: Settings, model: Option<Arc<Model>>) -> Core {
        Core {
            decoder: Decoder::new(),
            session: Session::new(settings, model),
        }
    }

    /// A port was opened.
    pub fn connected(&mut self, now: HostTime, effects: &mut dyn Effects) {
        self.decoder.reset();
        self.session.connected(now, effects);
    }

    /// The port was closed, or has gone.
    pub fn disconnected(&mut self) {
        self.session.disconnected();
    }

    /// Bytes came from the device.
    pub fn receive(&mut self, mut bytes: &[u8], read: HostTime, effects: &mut dyn Effects) {
        while let Some(outcome) = self.decoder.next::<ToHost>(&mut bytes) {
            match outcome {
                Ok(frame) => self.session.handle_frame(&frame, read, effects),
                Err(error) => self.session.handle_error(error, read),
            }
        }
        self.session.tick(read, effects);
    }

    /// Time passes: send what is due. Call at least every 100 ms.
    pub fn tick(&mut self, now: HostTime, effects: &mut dyn Effects) {
        self.session.tick(now, effects);
    }

    /// Frames shall come, or not.
    pub fn set_streaming(&mut self, streaming: bool) {
        self.session.commands.set_streaming(streaming);
    }

    /// Whether the device has stopped as wanted.
    pub fn is_stopped(&self) -> bool {
        self.session.commands.is_stopped()
    }

    /// Whether the port has been silent for so long that it should be opened anew.
    pub fn is_unresponsive(&self, now: HostTime) -> bool {
        self.session.commands.is_unresponsive(now.monotonic_us)
    }

    /// What the frame decoder has counted.
    pub fn wire_counters(&self) -> &Counters {
        self.decoder.counters()
    }

    /// What was received, lost and filled until now.
    pub fn summary(&self) -> Summary {
        Summary::new(&self.session, self.decoder.counters())
    }

    /// What goes to `/diagnostics`. Call it once a second: a loss is a warning for one call.
    pub fn diagnostics(&mut self, now: HostTime) -> DiagnosticArray {
        diagnose(&mut self.session, self.decoder.counters(), now)
    }
}
