//! Tests that invalid classifiers are refused, and that decisions equal results computed by hand.

use super::*;

/// A classifier with a window of two hops and one feature, the difference of its two electrodes.
/// The score of the second class is ln(energy) - ln(2^20).
fn classifier() -> Classifier {
    // 8 to 30 Hz at 128 Hz, as `butter(2, [8, 30], 'bandpass', fs=128)` of scipy; each section has
    // the square root of the total gain.
    let sections = [
        [0.403_467_658_652_642, 1.493_075_431_284_801, -0.653_316_093_047_275],
        [0.403_467_658_652_642, 0.299_224_745_896_560, -0.354_837_442_314_624],
    ];
    #[expect(clippy::cast_possible_truncation, reason = "below 2^33")]
    let sections = sections.map(|section: [f64; 3]| section.map(|x| (x * 4_294_967_296.0) as i64));
    Classifier {
        format: 1,
        electrodes: vec!["C3".to_owned(), "C4".to_owned()],
        step_rate_hz: 128,
        hop_steps: 8,
        band: Band { hz: [8.0, 30.0], sections },
        decision: DecisionRule {
            classes: vec![
                Class { code: 769, event: "T1".to_owned() },
                Class { code: 770, event: "T2".to_owned() },
            ],
            window_hops: 2,
            weights: vec![vec![0.0], vec![1.0]],
            bias: vec![0.0, -20.0 * std::f64::consts::LN_2],
        },
        filters: vec![SpatialFilter { weights: vec![127, -127], pattern: vec![1.0, -1.0] }],
        training: ClassifierTraining::default(),
    }
}

#[test]
fn a_file_is_read_as_it_was_written_and_its_id_depends_on_filters_alone() {
    let classifier = classifier();
    let text = classifier.to_toml().unwrap();
    let mut other = Classifier::parse(&text).unwrap();
    assert_eq!(other, classifier);
    other.decision.window_hops = 9;
    assert_eq!(other.id(), classifier.id());
    other.filters[0].weights[0] = 126;
    assert_ne!(other.id(), classifier.id());
}

#[test]
fn numbers_out_of_range_are_refused_by_the_name_of_their_field() {
    let refused = |change: fn(&mut Classifier)| {
        let mut classifier = classifier();
        change(&mut classifier);
        match classifier.check() {
            Err(ClassifierError::Field { field, .. }) => field,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(|c| c.format = 2), "format");
    assert_eq!(refused(|c| c.filters.clear()), "filters");
    assert_eq!(refused(|c| c.filters[0].weights[0] = -128), "filters.weights");
    assert_eq!(refused(|c| c.filters[0].weights = vec![0; 2]), "filters.weights");
    assert_eq!(refused(|c| c.filters[0].pattern.clear()), "filters.weights");
    assert_eq!(refused(|c| c.decision.classes[1].code = 769), "decision.classes");
    assert_eq!(refused(|c| c.decision.bias[0] = f64::NAN), "decision");
    // A pole outside the unit circle, then a resonance that could overflow.
    assert_eq!(refused(|c| c.band.sections[0][2] = -(1 << 32)), "band.sections");
    assert_eq!(refused(|c| c.band.sections[0][2] = -4_294_000_000), "band.sections");
}

#[test]
fn a_decision_is_the_softmax_of_the_mean_energy_over_the_window() {
    let mut decision = Decision::new(&classifier());
    assert_eq!(decision.probabilities(), [0.5, 0.5]);
    // Level 80 is the energy 2^20, at which both classes are equally probable.
    assert!((decision.add_hop(&[80]).probabilities[1] - 0.5).abs() < 1e-6);
    // The mean of 2^20 and 2^22 is 2.5 times 2^20: odds of 2.5.
    let prediction = decision.add_hop(&[96]);
    assert!((prediction.probabilities[1] - 2.5 / 3.5).abs() < 1e-6);
    assert!(prediction.is_settled);
    assert_eq!(prediction.class(), 1);
    // The first hop has left the window of two hops. The window now holds 2^22 twice: this is
    // odds of 4.
    assert!((decision.add_hop(&[96]).probabilities[1] - 0.8).abs() < 1e-6);
}

#[test]
fn after_a_gap_the_window_is_settled_once_half_of_it_is_usable() {
    let mut classifier = classifier();
    classifier.decision.window_hops = 4;
    let mut decision = Decision::new(&classifier);
    let settled = (0..4).map(|_| decision.add_hop(&[96]).is_settled).collect::<Vec<_>>();
    assert_eq!(settled, [false, false, false, true]);
    (0..9).for_each(|_| decision.skip_hop());
    // The gap does not change the probabilities, but drops the energies before it.
    assert!((decision.probabilities()[1] - 0.8).abs() < 1e-6);
    let prediction = decision.add_hop(&[80]);
    assert!((prediction.probabilities[1] - 0.5).abs() < 1e-6);
    assert!(!prediction.is_settled && decision.add_hop(&[80]).is_settled);
}

#[test]
fn a_device_with_another_montage_or_rate_is_refused() {
    let check = |labels: [&str; 2], rate| classifier().check_device(labels.into_iter(), rate, 8);
    assert!(check(["C3", "C4"], 128).is_ok());
    let error = check(["C4", "C3"], 128).unwrap_err().to_string();
    assert!(error.contains("C3 C4, but the device has the electrodes C4 C3"), "{error}");
    assert!(check(["C3", "C4"], 125).is_err());
}
