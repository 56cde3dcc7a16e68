//! Where the core's effects go.

use std::sync::Arc;

use neuro_ros::{
    AcquisitionInfo, DiagnosticArray, DiagnosticLevel, DiagnosticStatus, FrameSink, KeyValue,
    NeuroFrame, Sink, SinkError,
};
use tokio::sync::mpsc::UnboundedSender;

use crate::decoding::Decoding;
use crate::{Announcement, Effects, Model, Reconstruction, Settings, TimedCode};

/// Where the core's effects go. Nothing here waits for the network or the device.
pub(crate) struct Outlets {
    pub(crate) settings: Settings,
    pub(crate) model: Arc<Model>,
    pub(crate) encoded: Box<dyn FrameSink>,
    pub(crate) diagnostics: Box<dyn Sink<DiagnosticArray>>,
    pub(crate) decoding: Decoding,
    /// To whoever serves `/acquisition/get_info`; none without ROS.
    pub(crate) announcements: Option<UnboundedSender<AcquisitionInfo>>,
    /// What was announced last.
    pub(crate) announced: Option<AcquisitionInfo>,
    /// Figures of the last report.
    pub(crate) told: Vec<u64>,
    /// Bytes for the device that wait to be written.
    pub(crate) outgoing: Vec<u8>,
    /// The sink has ended for good.
    pub(crate) ended: Option<SinkError>,
}

impl Outlets {
    /// Publish the core's report and what the outlets have to add.
    pub(crate) fn diagnose(&mut self, mut report: DiagnosticArray) {
        report.status.push(self.status());
        if let Err(error) = self.diagnostics.publish(&report) {
            self.ended = Some(error);
        }
    }

    /// What did not reach its receivers.
    fn status(&mut self) -> DiagnosticStatus {
        let figures = [
            ("encoded frames dropped", self.encoded.dropped()),
            ("reconstructed frames dropped", self.decoding.dropped()),
            ("windows not decoded", self.decoding.undecoded()),
        ];
        let now: Vec<u64> = figures.iter().map(|(_, figure)| *figure).collect();
        let lost = now.iter().sum::<u64>() > self.told.iter().sum();
        self.told = now;
        let (level, message) = if self.decoding.is_dead() {
            let message = "the decoder has ended; restart the bridge for reconstructed frames";
            (DiagnosticLevel::Error, message)
        } else if lost {
            let message = "frames dropped since the last report: a subscriber or the host is slow";
            (DiagnosticLevel::Warn, message)
        } else {
            (DiagnosticLevel::Ok, "everything was taken")
        };
        DiagnosticStatus {
            level,
            name: "corticode: outlets".to_owned(),
            message: message.to_owned(),
            hardware_id: String::new(),
            values: figures
                .map(|(name, figure)| KeyValue::new(name, &figure))
                .to_vec(),
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
        let Some(announcements) = &self.announcements else {
            return;
        };
        let Some(info) = &announcement.info else {
            tracing::error!(
                "nothing is announced: --announce names a stream that is not published"
            );
            return;
        };
        if self.announced.as_ref() != Some(info) {
            self.announced = Some(info.clone());
            // An error means that the node is leaving: then nobody asks any more.
            let _ = announcements.send(info.clone());
        }
    }

    fn encoded(&mut self, frame: &NeuroFrame) {
        if let Err(error) = self.encoded.publish(frame) {
            self.ended = Some(error);
        }
    }

    fn window(&mut self, window: TimedCode) {
        self.decoding.window(window);
    }
}
