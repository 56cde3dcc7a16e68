//! The stream of features, from which a classifier computes predictions.

use std::sync::Arc;

use artifact::classifier::{Classifier, Decision};
use link::{Features, Flags};
use neuro_ros::{
    DiagnosticLevel, DiagnosticStatus, KeyValue, NeuroDataFloat, NeuroDataInfo, NeuroDataInt32,
    NeuroDecoder, NeuroOutput,
};

use crate::core::Effects;
use crate::device::Device;
use crate::session::summary::PredictionSummary;
use crate::settings::{FillerPolicy, Settings};
use crate::streams::hop_timeline::{HopPlace, HopTimeline};
use crate::streams::stamps::{DecodedStream, Decoding, MonotoneStamps, Reception};

/// Flags of hops whose features do not represent the EEG. After such a hop, the previous decision
/// stays. It also stays if an electrode that a filter uses was at the rail during the hop.
const UNUSABLE: [Flags; 3] = [Flags::SETTLING, Flags::OVERRUN, Flags::ADC_STATUS_BAD];

/// Classifies features, and publishes a prediction for each hop, even if the hop was lost.
///
/// Sequence numbers, counts and the window of the decision continue when the device restarts.
#[derive(Debug)]
pub(crate) struct FeatureStream {
    pub(crate) timeline: HopTimeline,
    classifier: Arc<Classifier>,
    /// Bit mask of the electrodes that a filter uses; bit n is channel n.
    used: u64,
    decision: Decision,
    output: NeuroOutput,
    stamps: MonotoneStamps,
    /// Number of hops whose features were not used, because other filters computed them.
    foreign: u64,
    /// Number of predictions published, including repeated ones.
    published: u64,
    /// Number of hops whose features were lost or not usable.
    repeated: u64,
    /// State of the newest features.
    newest: Newest,
}

/// State of a device's newest features.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Newest {
    /// No features have arrived.
    Missing,
    /// The features were computed by other filters than the classifier's.
    Foreign,
    /// The features were lost or not usable, so the previous prediction was repeated.
    Unusable,
    Used,
}

impl FeatureStream {
    pub(crate) fn new(
        device: Arc<Device>,
        classifier: Arc<Classifier>,
        settings: Settings,
    ) -> FeatureStream {
        let decoding = Decoding { stream: DecodedStream::Codes, is_possible: false };
        FeatureStream {
            timeline: HopTimeline::new("features", device, decoding, settings),
            used: classifier.used_electrodes(),
            decision: Decision::new(&classifier),
            output: output(&classifier),
            classifier,
            stamps: MonotoneStamps::default(),
            foreign: 0,
            published: 0,
            repeated: 0,
            newest: Newest::Missing,
        }
    }

    /// Starts another run: the device counts hops from 0 again.
    pub(crate) fn restart(&mut self) {
        self.timeline.restart();
        self.newest = Newest::Missing;
    }

    /// Ends the recording, because the user has stopped the stream. The pause is not filled.
    pub(crate) fn end_recording(&mut self) {
        self.timeline.end_recording();
        self.decision = Decision::new(&self.classifier);
    }

    /// Returns the status `predictions` for `/diagnostics`, which counts lost features and repeated
    /// predictions.
    pub(crate) fn status(&self) -> DiagnosticStatus {
        let counts = self.timeline.counts();
        let classes = self.classifier.decision.classes.iter();
        let classes: Vec<&str> = classes.map(|class| class.event.as_str()).collect();
        let decides = format!("decides between {}", classes.join(" and "));
        let (level, message) = match self.newest {
            Newest::Missing => (
                DiagnosticLevel::Warn,
                "no features have arrived; the log says if the device has refused them",
            ),
            Newest::Foreign => (
                DiagnosticLevel::Error,
                "features of other filters arrive, which the classifier cannot use",
            ),
            Newest::Unusable => (
                DiagnosticLevel::Warn,
                "the newest prediction is repeated: the hop was lost, or its signals were unusable",
            ),
            Newest::Used => (DiagnosticLevel::Ok, decides.as_str()),
        };
        let values = vec![
            KeyValue::new("features lost", &counts.missing()),
            KeyValue::new("predictions repeated", &self.repeated),
            KeyValue::new("features of other filters", &self.foreign),
            KeyValue::new("window hops", &self.classifier.decision.window_hops),
        ];
        DiagnosticStatus::new("predictions", (level, message.to_owned()), values)
    }

    /// Returns the counts for the summary that a program prints when it ends.
    pub(crate) fn summary(&self) -> PredictionSummary {
        PredictionSummary {
            published: self.published,
            repeated: self.repeated,
            lost: self.timeline.counts().missing(),
        }
    }

    /// Publishes the prediction of a hop. If hops before it were lost, first publishes the previous
    /// prediction again for each of them, unless the user wants no fillers.
    pub(crate) fn receive(
        &mut self,
        features: &Features,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let expected = (self.classifier.id(), self.classifier.filters.len());
        if (features.id, features.levels.len()) != expected {
            if self.foreign == 0 {
                tracing::error!(
                    "the device's features are of filters {:08x}, not of the classifier's {:08x}; another \
                     program has set them, or the recording was made with another classifier",
                    features.id,
                    self.classifier.id()
                );
            }
            self.foreign += 1;
            self.newest = Newest::Foreign;
            return;
        }
        if self.timeline.is_restart(features.hop) {
            self.restart();
        }
        let most = effects.max_fillers();
        let placed = self.timeline.receive(features.hop, reception, most);
        let Some((missing, place)) = placed else {
            return;
        };
        let has_fillers = self.timeline.settings.filler != FillerPolicy::Off;
        if has_fillers {
            self.timeline.count_fillers(missing.len());
        }
        for place in missing {
            if has_fillers {
                self.repeat(place, Flags::FILLER, reception, effects);
            } else {
                self.decision.skip_hop();
            }
        }
        let is_railed = features.saturated & self.used != 0;
        if is_railed || UNUSABLE.iter().any(|flag| features.flags.contains(*flag)) {
            return self.repeat(place, features.flags, reception, effects);
        }
        let prediction = self.decision.add_hop(features.levels);
        self.newest = Newest::Used;
        let class = prediction.is_settled.then(|| prediction.class());
        self.publish(place, features.flags, class, reception, effects);
    }

    /// Publishes the newest probabilities again, without a chosen class.
    fn repeat(
        &mut self,
        place: HopPlace,
        flags: Flags,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        self.repeated += 1;
        self.newest = Newest::Unusable;
        self.decision.skip_hop();
        self.publish(place, flags, None, reception, effects);
    }

    fn publish(
        &mut self,
        place: HopPlace,
        flags: Flags,
        class: Option<usize>,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        self.published += 1;
        self.timeline.record(place, reception);
        let hop = u32::from(self.timeline.device.hop_steps);
        let time = self.timeline.frame_time_ns(place, [hop - 1, hop], reception);
        let steps_back = reception.clock.wall_steps_back();
        let end = (u64::from(place.index) + 1) * u64::from(hop);
        let last_sample = self.timeline.device.sample_of_step(end - 1);
        let words = place.words(flags, last_sample, reception);
        let output = &mut self.output;
        output.header.stamp = self.stamps.next(time, steps_back);
        output.neuroheader.seq = output.neuroheader.seq.wrapping_add(1);
        output.header.seq = output.neuroheader.seq;
        let set = Flags::NAMES.iter().filter(|(flag, _)| flags.contains(*flag));
        let names: Vec<&str> = set.map(|(_, name)| *name).collect();
        output.header.frame_id = names.join(" ");
        let probabilities = self.decision.probabilities();
        output.softpredict.data.copy_from_slice(probabilities);
        for (index, chosen) in output.hardpredict.data.iter_mut().enumerate() {
            *chosen = i32::from(class == Some(index));
        }
        effects.publish_prediction(output, words);
    }
}

/// Returns the message for a classifier's predictions, with all probabilities 0.
fn output(classifier: &Classifier) -> NeuroOutput {
    let [low, high] = classifier.band.hz;
    let classes = &classifier.decision.classes;
    let info = NeuroDataInfo {
        nsamples: 1,
        unit: "probability".to_owned(),
        transducter: "spatial filters".to_owned(),
        prefiltering: format!("BP:{low}-{high}Hz"),
        minmax: vec![0.0, 1.0],
        ..NeuroDataInfo::default()
    };
    let info = info.with_labels(classes.iter().map(|class| class.event.clone()).collect());
    NeuroOutput {
        softpredict: NeuroDataFloat { data: vec![0.0; classes.len()], info: info.clone() },
        hardpredict: NeuroDataInt32 {
            data: vec![0; classes.len()],
            info: NeuroDataInfo { isint: 1, ..info },
        },
        decoder: NeuroDecoder {
            r#type: "corticode".to_owned(),
            path: format!("{:08x}", classifier.id()),
            classes: classes.iter().map(|class| class.code).collect(),
        },
        ..NeuroOutput::default()
    }
}
