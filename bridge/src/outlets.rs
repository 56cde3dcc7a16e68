//! Where the core's effects go.

use std::sync::Arc;

use neuro_ros::{AcquisitionInfo, DiagnosticArray, FrameSink, NeuroFrame, Sink, SinkError};
use tokio::sync::mpsc::UnboundedSender;

use crate::decoding::Decoding;
use crate::{Announcement, Effects, Model, Reconstruction, Settings, Window};

/// Where the core's effects go. Nothing here waits for the network or the device.
pub(crate) struct Outlets {
    pub(crate) settings: Settings,
    pub(crate) model: Arc<Model>,
    pub(crate) encoded: Box<dyn FrameSink>,
    pub(crate) diagnostics: Box<dyn Sink<DiagnosticArray>>,
    pub(crate) decoding: Decoding,
    /// To whoever serves `/acquisition/get_info`; none without ROS.
    pub(crate) announcements: Option<UnboundedSender<AcquisitionInfo>>,
    /// Bytes for the device that wait to be written.
    pub(crate) outgoing: Vec<u8>,
    /// The sink has ended for good.
    pub(crate) ended: Option<SinkError>,
}

impl Outlets {
    pub(crate) fn diagnose(&mut self, report: &DiagnosticArray) {
        if let Err(error) = self.diagnostics.publish(report) {
            self.ended = Some(error);
        }
    }
}

impl Effects for Outlets {
    fn send(&mut self, frame: &[u8]) {
        self.outgoing.extend_from_slice(frame);
    }

    fn announce(&mut self, announcement: &Announcement) {
        if announcement.decodable {
            let model = Arc::clone(&self.model);
            self.decoding.begin(Reconstruction::new(
                &announcement.device,
                model,
                self.settings,
            ));
        }
        if let Some(announcements) = &self.announcements {
            // An error means that the node is leaving: then nobody asks any more.
            let _ = announcements.send(announcement.info.clone());
        }
    }

    fn encoded(&mut self, frame: &NeuroFrame) {
        if let Err(error) = self.encoded.publish(frame) {
            self.ended = Some(error);
        }
    }

    fn window(&mut self, window: Window) {
        self.decoding.window(window);
    }
}
