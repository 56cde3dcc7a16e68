//! A source and the bridge's core, which exchange bytes in virtual time.

use std::sync::Arc;

use artifact::Artifact;
use artifact::classifier::Classifier;
use bridge_core::{Announcement, AuditedWindow, Core, Effects, HostTime, Model, Settings, Upload};
use link::{Flags, Streams};
use neuro_ros::{DiagnosticStatus, NeuroFrame, NeuroOutput, TriWords};
use node::{Arrival, Refusal, Source};
use pipeline::Mains;

use crate::acquisition::Acquisition;

/// Time at which the first frame arrives.
pub(crate) const START: HostTime =
    HostTime { monotonic_us: 1_000_000_000, wall_ns: 1_700_000_000_000_000_000 };

/// Collects what the core sends, announces and publishes.
pub(crate) struct Recorder {
    sent: Vec<u8>,
    /// The model with which the device must encode.
    model: Arc<Model>,
    /// Number of codes that were compared with the model's codes.
    pub(crate) audits: usize,
    pub(crate) announced: Vec<Announcement>,
    pub(crate) encoded: Vec<NeuroFrame>,
    pub(crate) predictions: Vec<NeuroOutput>,
}

impl Effects for Recorder {
    fn send(&mut self, frame: &[u8]) {
        self.sent.extend_from_slice(frame);
    }

    fn announce(&mut self, announcement: &Announcement) {
        self.announced.push(announcement.clone());
    }

    fn publish_encoded(&mut self, frame: &NeuroFrame) {
        self.encoded.push(frame.clone());
    }

    fn publish_prediction(&mut self, prediction: &NeuroOutput, _: TriWords) {
        self.predictions.push(prediction.clone());
    }

    fn audit(&mut self, window: AuditedWindow) {
        let result = window.compare(&self.model).expect("a code");
        assert!(!result.is_wrong(), "{result:?}");
        self.audits += 1;
    }
}

pub(crate) struct Harness {
    pub(crate) source: Source,
    pub(crate) core: Core,
    pub(crate) recorder: Recorder,
    pub(crate) now: HostTime,
}

impl Harness {
    /// Connects the core to a new source, and encodes `first`, the first frame.
    pub(crate) fn new(first: &NeuroFrame) -> Harness {
        Harness::with_classifier(first, None)
    }

    /// Like [`Self::new`], for a core with a classifier.
    pub(crate) fn with_classifier(first: &NeuroFrame, classifier: Option<Classifier>) -> Harness {
        Harness::with(first, classifier, None)
    }

    /// Like [`Self::new`], for a core that uploads a person's model to the device.
    pub(crate) fn with_person(first: &NeuroFrame, person: &Artifact) -> Harness {
        Harness::with(first, None, Some(person))
    }

    fn with(
        first: &NeuroFrame,
        classifier: Option<Classifier>,
        person: Option<&Artifact>,
    ) -> Harness {
        let features = classifier.as_ref().map(|_| Streams::FEATURES);
        let settings = Settings {
            mains_hz: 50,
            streams: Streams::CODES | Streams::AUDIT | features.unwrap_or_default(),
            ..Settings::default()
        };
        let model = person.map_or_else(Model::embedded, Model::new).unwrap();
        let model = Arc::new(model);
        let recorder = Recorder {
            sent: Vec::new(),
            model: Arc::clone(&model),
            audits: 0,
            announced: Vec::new(),
            encoded: Vec::new(),
            predictions: Vec::new(),
        };
        let mut harness = Harness {
            source: Source::new(first, Mains::Hz50, 1).unwrap(),
            core: Core::new(settings, Some(model)),
            recorder,
            now: START,
        };
        if let Some(person) = person {
            let bytes = model_gen::upload(person).unwrap().unwrap();
            let upload = Upload::new(person.id.0, bytes.into());
            harness.core.set_upload(upload);
        }
        if let Some(classifier) = classifier {
            harness.core.set_classifier(classifier);
        }
        harness.core.connected(START, &mut harness.recorder);
        harness.exchange();
        assert!(harness.source.is_streaming());
        harness.encode(first, 0);
        harness
    }

    /// Receives a frame that arrives `us` microseconds after the previous one.
    pub(crate) fn receive(&mut self, frame: &NeuroFrame, us: i64) -> Result<Arrival, Refusal> {
        self.now.monotonic_us += us;
        self.now.wall_ns += us * 1000;
        let arrival = self.source.check(frame)?;
        match arrival {
            Arrival::Lost(frames) => self.encode(frame, frames),
            Arrival::Restarted => {
                self.source.restart(self.now).unwrap();
                self.exchange();
                assert!(self.source.is_streaming());
                self.encode(frame, 0);
            }
            Arrival::Next | Arrival::Repeated => self.encode(frame, 0),
        }
        Ok(arrival)
    }

    /// Receives the frames with these indices, each one frame's duration after the previous one.
    pub(crate) fn receive_all(
        &mut self,
        acquisition: &Acquisition,
        indices: impl IntoIterator<Item = u32>,
    ) {
        let frame_us = self.source.layout().frame_us();
        for index in indices {
            self.receive(&acquisition.frame(index), frame_us).unwrap();
        }
    }

    fn encode(&mut self, frame: &NeuroFrame, lost: u32) {
        self.source.encode(frame, lost, self.now);
        self.exchange();
    }

    /// Passes bytes between source and core until neither has any left.
    fn exchange(&mut self) {
        loop {
            let sent = std::mem::take(&mut self.recorder.sent);
            if !sent.is_empty() {
                self.source.receive(&sent, self.now);
            }
            match self.source.next_bytes() {
                Some((read, bytes)) => self.core.receive(&bytes, read, &mut self.recorder),
                None if sent.is_empty() => return,
                None => {}
            }
        }
    }

    /// Returns the status `name` of the core's diagnostics.
    pub(crate) fn status(&mut self, name: &str) -> DiagnosticStatus {
        let report = self.core.diagnostics(self.now);
        let mut statuses = report.status.into_iter();
        statuses.find(|status| status.name == name).unwrap()
    }
}

/// Returns the status word `label` of a frame.
pub(crate) fn word(frame: &NeuroFrame, label: &str) -> i32 {
    let labels = &frame.tri.info.labels;
    let place = labels.iter().position(|name| name == label).unwrap();
    frame.tri.data[place]
}

pub(crate) fn is_filler(frame: &NeuroFrame) -> bool {
    word(frame, "flags") & i32::from(Flags::FILLER.bits()) != 0
}
