//! Predictions from the device's features: what the device receives, and what is published.

use artifact::classifier::{
    Band, Class, Classifier, ClassifierTraining, DecisionRule, SpatialFilter,
};
use bridge_core::Settings;
use link::{Features, Flags, Streams, ToDevice, ToHost};
use neuro_ros::{DiagnosticLevel, NeuroOutput};

use crate::board::Board;
use crate::recorder::{Harness, SETTINGS, commands, state};

const FEATURES: Settings = Settings { streams: Streams::FEATURES, ..SETTINGS };

/// A classifier for the board's montage with a window of two hops. Its second class is as probable
/// as the first at level 80, which is the energy 2^20.
fn classifier(board: &Board) -> Classifier {
    let electrodes: Vec<String> = board.labels.split(' ').map(str::to_owned).collect();
    let class = |code, event: &str| Class { code, event: event.to_owned() };
    Classifier {
        format: 1,
        step_rate_hz: 128,
        hop_steps: 8,
        band: Band { hz: [8.0, 30.0], sections: [[1 << 30, 1 << 31, -(1 << 31)]; 2] },
        decision: DecisionRule {
            classes: vec![class(769, "T1"), class(770, "T2")],
            window_hops: 2,
            weights: vec![vec![0.0], vec![1.0]],
            bias: vec![0.0, -20.0 * std::f64::consts::LN_2],
        },
        filters: vec![SpatialFilter {
            weights: (0..electrodes.len()).map(|e| [17, -17][e % 2]).collect(),
            pattern: vec![0.0; electrodes.len()],
        }],
        electrodes,
        training: ClassifierTraining::default(),
    }
}

/// A bridge with a classifier, and a simulated board that streams features to it.
struct Loop {
    harness: Harness,
    id: u32,
    hop: u32,
    saturated: u64,
}

impl Loop {
    fn new() -> Loop {
        let board = Board::new();
        let classifier = classifier(&board);
        let id = classifier.id();
        let mut harness = Harness::new(FEATURES, board);
        harness.core.set_classifier(classifier);
        harness.connect();
        Loop { harness, id, hop: 0, saturated: 0 }
    }

    /// Advances time by a hop, for which the board sends the level of one filter.
    fn hop(&mut self, level: u8, flags: Flags) {
        self.harness.now_us += 62_500;
        let features = Features {
            id: self.id,
            hop: self.hop,
            flags,
            saturated: self.saturated,
            levels: &[level],
        };
        let at_us = self.harness.now_us.unsigned_abs();
        self.harness.send(at_us, &ToHost::Features(features));
        self.hop += 1;
    }

    fn lose(&mut self, hops: u32) {
        self.harness.now_us += i64::from(hops) * 62_500;
        self.hop += hops;
    }

    /// Returns, for each prediction, the probability of the second class, the chosen class, and the
    /// flags.
    fn predictions(&self) -> Vec<(f32, Option<usize>, &str)> {
        let predictions = self.harness.recorder.predictions.iter();
        let summary = |output: &'_ NeuroOutput| {
            let chosen = output.hardpredict.data.iter().position(|value| *value == 1);
            (output.softpredict.data[1], chosen)
        };
        predictions
            .map(|output| {
                let (probability, chosen) = summary(output);
                (probability, chosen, output.header.frame_id.as_str())
            })
            .collect()
    }
}

#[test]
fn the_device_is_given_the_filters_before_it_streams_and_after_each_restart() {
    let mut bridge = Loop::new();
    let with_filters = ["stop", "set features", "start"];
    assert_eq!(commands(&bridge.harness)[1..], with_filters);
    let received = &bridge.harness.board.received;
    let given = received.iter().find_map(|(_, command)| match command {
        ToDevice::SetFeatures(filters) => Some((filters.id, filters.first.gain)),
        _ => None,
    });
    assert_eq!(given, Some((bridge.id, 1 << 30)));
    assert_eq!(bridge.harness.board.streams, Streams::FEATURES);
    bridge.harness.board.received.clear();
    bridge.harness.reboot(1_000_000);
    assert_eq!(commands(&bridge.harness), with_filters);
}

#[test]
fn each_hop_has_a_prediction_and_lost_or_unusable_ones_repeat_the_last() {
    let mut bridge = Loop::new();
    bridge.hop(200, Flags::SETTLING);
    bridge.hop(72, Flags::empty());
    bridge.hop(96, Flags::empty());
    bridge.lose(2);
    bridge.hop(0, Flags::OVERRUN);
    // A channel without an electrode is at the rail.
    bridge.saturated = 1 << 63;
    bridge.hop(96, Flags::SUBSTITUTED);
    bridge.saturated = 1;
    bridge.hop(0, Flags::SATURATED);
    bridge.saturated = 0;
    bridge.hop(96, Flags::empty());
    // Odds of the second class: 1/2 for the energy 2^19, 4 for 2^22, and 2.25 for their mean.
    let (low, both, high) = (1.0 / 3.0, 2.25 / 3.25, 0.8);
    let expected = [
        (0.5, None, "settling"),
        (low, Some(0), ""),
        (both, Some(1), ""),
        (both, None, "filler"),
        (both, None, "filler"),
        (both, None, "overrun"),
        (high, Some(1), "substituted"),
        (high, None, "saturated"),
        (high, Some(1), ""),
    ];
    let made = bridge.predictions();
    assert_eq!(made.len(), expected.len(), "{made:?}");
    for (made, expected) in made.iter().zip(expected) {
        assert!((made.0 - expected.0).abs() < 1e-6, "{made:?} {expected:?}");
        assert_eq!((made.1, made.2), (expected.1, expected.2));
    }
    let outputs = &bridge.harness.recorder.predictions;
    assert_eq!(outputs[0].decoder.classes, [769, 770]);
    assert_eq!(outputs[0].softpredict.info.labels, ["T1", "T2"]);
    for (before, after) in outputs.iter().zip(&outputs[1..]) {
        let [before, after] = [before, after].map(|o| (o.neuroheader.seq, o.header.stamp));
        assert_eq!(after.0, before.0 + 1);
        let hop_ns = after.1.nanoseconds() - before.1.nanoseconds();
        assert!((hop_ns - 62_500_000).abs() < 1_000_000, "{hop_ns}");
    }
    let status = bridge.harness.status("predictions").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
}

#[test]
fn features_of_other_filters_are_no_prediction_but_an_error() {
    let mut bridge = Loop::new();
    bridge.hop(80, Flags::empty());
    bridge.id ^= 1;
    bridge.hop(80, Flags::empty());
    assert_eq!(bridge.predictions().len(), 1);
    let status = bridge.harness.status("predictions").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Error);
}

#[test]
fn a_classifier_of_another_montage_decides_nothing() {
    let board = Board::new();
    let mut other = classifier(&board);
    other.electrodes.swap(0, 1);
    let mut harness = Harness::new(FEATURES, board);
    harness.core.set_classifier(other);
    harness.connect();
    let status = harness.status("predictions").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Error);
    assert!(harness.recorder.predictions.is_empty());
}

#[test]
fn firmware_without_features_streams_everything_else() {
    let others = Streams::CODES | Streams::RAW | Streams::PACKED;
    let board = Board { supported: Streams::ALL.without(Streams::FEATURES), ..Board::new() };
    let classifier = classifier(&board);
    let settings = Settings { streams: others | Streams::FEATURES, ..SETTINGS };
    let mut harness = Harness::new(settings, board);
    harness.core.set_classifier(classifier);
    harness.connect();
    harness.codes(3, 1);
    assert_eq!(harness.recorder.encoded.len(), 3);
    assert_eq!(harness.board.streams, others);
    let (level, _) = state(&harness.status("device").unwrap());
    assert_eq!(level, DiagnosticLevel::Warn);
}
