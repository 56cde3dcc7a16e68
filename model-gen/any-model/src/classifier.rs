//! A classifier with constant weights, which was not trained on any data.

use artifact::classifier::{
    Band, Class, Classifier, ClassifierTraining, DecisionRule, SpatialFilter,
};

/// Returns a classifier for electrodes with these labels, at 128 steps per second in hops of eight.
/// More power between 8 and 30 Hz at the first quarter of the electrodes makes class 773 more
/// probable, at the last quarter class 771. The power is averaged over 16 hops.
pub fn any_classifier<'l>(labels: impl IntoIterator<Item = &'l str>) -> Classifier {
    let electrodes: Vec<String> = labels.into_iter().map(str::to_owned).collect();
    let count = electrodes.len();
    let class = |code, event: &str| Class { code, event: event.to_owned() };
    let filter = |quarter: std::ops::Range<usize>| SpatialFilter {
        weights: (0..count)
            .map(|electrode| if quarter.contains(&electrode) { 60 } else { -15 })
            .collect(),
        pattern: vec![0.0; count],
    };
    Classifier {
        format: 1,
        electrodes,
        step_rate_hz: 128,
        hop_steps: 8,
        band: Band {
            hz: [8.0, 30.0],
            sections: [
                [1_732_880_386, 6_412_710_145, -2_805_971_273],
                [1_732_880_386, 1_285_160_498, -1_524_016_507],
            ],
        },
        decision: DecisionRule {
            classes: vec![class(773, "front"), class(771, "back")],
            window_hops: 16,
            weights: vec![vec![1.0, 0.0], vec![0.0, 1.0]],
            bias: vec![0.0; 2],
        },
        filters: vec![filter(0..count / 4), filter(count - count / 4..count)],
        training: ClassifierTraining::default(),
    }
}
